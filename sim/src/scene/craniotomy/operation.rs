//! An operation: what its host does while frames run, and between them.

use std::any::Any;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::feel::Feel;
use super::opening::{Opening, Planned};
use super::score::{Report, Score};
use super::script::Script;
use super::steps::{self, Step};
use super::{SKULL, TIME_STEP, TOOLS, freeing};
use crate::behavior::Bone;
use crate::device::link::{SimulationEnd, ToolState};
use crate::device::motion::Motion;
use crate::geometry::Bounds;
use crate::mailbox::Mailbox;
use crate::manager::VeManager;
use crate::message::Message;
use crate::object::Object;
use crate::render::Renderer;
use crate::scene::Scene;
use crate::scene::head::{Entry, Head};

/// Frames from one look for freed bone to the next; usually 60: a second. Looks are made before frames
/// whose numbers are multiples of it.
pub const LOOK_FRAMES: u64 = 60;
/// How far around the planned opening freed bone is looked for, in metres; usually 15 mm.
const MARGIN: f32 = 0.015;

/// What the host of an operation does: it moves the hands, keeps the score, and makes an object of bone that
/// comes free. A hand that a haptic loop is linked to moves as its device does, and feels what its tool meets.
pub struct Operation<'c> {
    head: Arc<Head>,
    script: Script,
    feels: Feels<'c>,
    score: Score,
    planned: Planned,
    region: Bounds,
    /// What the skull had lost at the last look.
    removed: u64,
}

/// The hands that haptic loops are linked to. What posts and what watches take turns with them: neither ever waits.
type Feels<'c> = [Option<Mutex<Feel<'c>>>; 2];

fn lock<'f, 'c>(feel: &'f Mutex<Feel<'c>>) -> MutexGuard<'f, Feel<'c>> {
    feel.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<'c> Operation<'c> {
    /// An operation on a head, scripted as far as `step` says; without one nobody moves the hands.
    #[must_use]
    pub fn new(head: Arc<Head>, step: Option<Step>) -> Self {
        let script =
            step.map_or_else(|| Script::new(TOOLS, TIME_STEP), |step| steps::script(&head, step));
        let (planned, region) = (Planned::new(&head), region(&head));
        let (feels, score) = ([None, None], Score::new(TIME_STEP));
        Self { head, script, feels, score, planned, region, removed: 0 }
    }

    /// Links hand number `hand` (0 or 1) with a haptic loop: from the next frame on its tool is where the
    /// device is, and the script says no more than which instrument it is. The loop's hand feels the tool.
    /// A hand that there is not is not linked.
    pub fn link(&mut self, hand: usize, end: SimulationEnd<'c>) {
        if let Some(feel) = self.feels.get_mut(hand) {
            *feel = Some(Mutex::new(Feel::new(end)));
        }
    }

    /// Takes the haptic loops' ends back: loops feel nothing, and hands are scripted again, each from where the
    /// script next moves it. Until then its tool stays as the device left it, buttons included.
    pub fn unlink(&mut self) -> [Option<SimulationEnd<'c>>; 2] {
        let end = |feel: Mutex<Feel<'c>>| {
            feel.into_inner().unwrap_or_else(PoisonError::into_inner).into_end()
        };
        std::mem::take(&mut self.feels).map(|feel| feel.map(end))
    }

    /// The frames that the script takes.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.script.frames()
    }

    /// What hand number `hand` (0 or 1) does by the script, for a simulated device to follow; none for one that
    /// does nothing. The clock begins with the first frame.
    #[must_use]
    pub fn motion(&self, hand: usize) -> Option<Motion> {
        self.script.motion(hand)
    }

    /// The place of the operation, for who looks at it.
    #[must_use]
    pub fn region(&self) -> Bounds {
        self.region
    }

    /// Splits it into what posts and what watches: the one is told of every frame that was swapped, the
    /// other is the renderer.
    pub fn parts<'a>(
        &'a mut self,
        renderer: &'a mut dyn Renderer,
    ) -> (Hands<'a, 'c>, Watch<'a, 'c>) {
        let Self { head, script, feels, score, .. } = self;
        (Hands { script, feels }, Watch { renderer, head, feels, score })
    }

    /// What was measured so far; `visit` shows the environment's objects, in any order:
    /// [`VeManager::visit`]. It takes less than 2 ms, mostly for the skull.
    pub fn report(&self, visit: impl FnOnce(&mut dyn FnMut(&Object))) -> Report {
        let mut opening = Opening::new(&self.head, &self.planned);
        visit(&mut |object| opening.see(object));
        self.score.report(&self.head.plan.burr_hole, &opening)
    }

    /// Whether bone was drilled since the last look, and some is free.
    fn is_due(&mut self, manager: &VeManager) -> bool {
        let mut removed = 0;
        manager.visit(&mut |object| {
            let behavior: &dyn Any = &*object.behavior;
            if let Some(bone) = behavior.downcast_ref::<Bone>() {
                removed += bone.removed();
            }
        });
        if std::mem::replace(&mut self.removed, removed) == removed {
            return false;
        }
        let mut is_any_free = false;
        manager.visit(&mut |object| {
            if object.id() == SKULL
                && let Some(skull) = object.geometry.as_volume()
            {
                is_any_free = !freeing::free_parts(skull, &self.region).is_empty();
            }
        });
        is_any_free
    }

    /// Looks for freed bone between two runs, and makes objects of it. Gives the manager back, or another
    /// one of the same settings, which `manage` makes, and how many objects are new.
    ///
    /// It looks only before frames whose numbers are multiples of [`LOOK_FRAMES`], so that bone comes free in the same
    /// frame however long the runs are; before all others it gives the manager back as it is. So its host ends a run
    /// before each of these frames, and looks then: a run has at most `LOOK_FRAMES - manager.frame() % LOOK_FRAMES`.
    ///
    /// # Errors
    /// Those of `manage`, which has the environment then.
    pub fn look<E>(
        &mut self,
        manager: VeManager,
        manage: impl FnOnce(Scene) -> Result<VeManager, E>,
    ) -> Result<(VeManager, usize), E> {
        if !manager.frame().is_multiple_of(LOOK_FRAMES) || !self.is_due(&manager) {
            return Ok((manager, 0));
        }
        let mut scene = manager.into_scene();
        let count = self.free(&mut scene);
        Ok((manage(scene)?, count))
    }

    /// Makes objects of the bone that is free; says of how many pieces.
    pub fn free(&self, scene: &mut Scene) -> usize {
        freeing::free(scene, SKULL, &self.region)
    }
}

/// What moves the hands.
#[derive(Clone, Copy)]
pub struct Hands<'a, 'c> {
    script: &'a Script,
    feels: &'a Feels<'c>,
}

impl Hands<'_, '_> {
    /// A frame was swapped: posts what the hands do two frames later.
    pub fn swapped(&self, frame: u64, mailbox: &Mailbox) {
        self.script.post(frame, self.feels.each_ref().map(Option::is_some), mailbox);
        for (tool, feel) in TOOLS.into_iter().zip(self.feels) {
            let sample = feel.as_ref().and_then(|feel| lock(feel).sample());
            sample.into_iter().for_each(|sample| mailbox.post(tool, Message::Device(sample)));
        }
    }

    /// The device of hand number `hand` (0 or 1) at the last swap, with all that its loop has measured, and why it cannot
    /// be read or written, if it cannot: its tool stays where it was then, and after 0.25 s lets go of its buttons, as
    /// after 0.25 s in which the loop says nothing, since it was stopped or its driver hangs. None where no
    /// loop is linked, or none has said anything yet.
    #[must_use]
    pub fn device(&self, hand: usize) -> Option<ToolState> {
        lock(self.feels.get(hand)?.as_ref()?).told().copied()
    }
}

/// A renderer that keeps the score of what it is shown, and lets hands feel it.
pub struct Watch<'a, 'c> {
    renderer: &'a mut dyn Renderer,
    head: &'a Head,
    feels: &'a Feels<'c>,
    score: &'a mut Score,
}

impl Renderer for Watch<'_, '_> {
    fn draw(&mut self, object: &Object) {
        if let Some(hand) = TOOLS.iter().position(|&tool| tool == object.id()) {
            self.score.note(hand, object, |place| self.head.inner_at(place) - place.length());
            if let Some(feel) = &self.feels[hand] {
                lock(feel).tool(object);
            }
        } else if object.geometry.as_volume().is_some() {
            self.feels.iter().flatten().for_each(|feel| lock(feel).bone(object));
        }
        self.renderer.draw(object);
    }

    fn swap(&mut self, frame: u64) {
        self.score.frame();
        self.feels.iter().flatten().for_each(|feel| lock(feel).deliver());
        self.renderer.swap(frame);
    }

    fn is_bound(&self) -> bool {
        self.renderer.is_bound()
    }
}

/// The box around the planned opening, through the skull.
fn region(head: &Head) -> Bounds {
    let places = head
        .plan
        .craniotomy
        .iter()
        .flat_map(|&Entry { point, inward, thickness }| [point, point + inward * thickness]);
    Bounds::around(places).inflated(MARGIN)
}
