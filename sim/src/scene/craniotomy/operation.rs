//! An operation: what its host does while frames run, and between them.

use std::any::Any;
use std::sync::Arc;

use super::opening::{Opening, Planned};
use super::score::{Report, Score};
use super::script::Script;
use super::steps::{self, Step};
use super::{SKULL, TIME_STEP, TOOLS, freeing};
use crate::behavior::Bone;
use crate::executor::ExecutorError;
use crate::geometry::Bounds;
use crate::mailbox::Mailbox;
use crate::manager::VeManager;
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
/// comes free.
pub struct Operation {
    head: Arc<Head>,
    script: Script,
    score: Score,
    planned: Planned,
    region: Bounds,
    /// What the skull had lost at the last look.
    removed: u64,
}

impl Operation {
    /// An operation on a head, scripted as far as `step` says; without one nobody moves the hands.
    #[must_use]
    pub fn new(head: Arc<Head>, step: Option<Step>) -> Self {
        let script =
            step.map_or_else(|| Script::new(TOOLS, TIME_STEP), |step| steps::script(&head, step));
        let (planned, region) = (Planned::new(&head), region(&head));
        Self { head, script, score: Score::new(TIME_STEP), planned, region, removed: 0 }
    }

    /// The frames that the script takes.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.script.frames()
    }

    /// The place of the operation, for who looks at it.
    #[must_use]
    pub fn region(&self) -> Bounds {
        self.region
    }

    /// Splits it into what posts and what watches: the one is told of every frame that was swapped, the
    /// other is the renderer.
    pub fn parts<'a>(&'a mut self, renderer: &'a mut dyn Renderer) -> (Hands<'a>, Watch<'a>) {
        let Self { head, script, score, .. } = self;
        (Hands { script }, Watch { renderer, head, score })
    }

    /// What was measured so far; `visit` shows the environment's objects, in any order:
    /// [`VeManager::visit`]. It takes less than 2 ms, mostly for the skull.
    pub fn report(&self, visit: impl FnOnce(&mut dyn FnMut(&Object))) -> Report {
        let mut opening = Opening::new(&self.head, &self.planned);
        visit(&mut |object| opening.see(object));
        self.score.report(&self.head.plan.burr_hole, &opening)
    }

    /// Whether bone was drilled since the last look, so that some may be free.
    fn is_due(&mut self, manager: &VeManager) -> bool {
        let mut removed = 0;
        manager.visit(&mut |object| {
            let behavior: &dyn Any = &*object.behavior;
            if let Some(bone) = behavior.downcast_ref::<Bone>() {
                removed += bone.removed();
            }
        });
        std::mem::replace(&mut self.removed, removed) != removed
    }

    /// Looks for freed bone between two runs, and makes objects of it. Gives the manager back, or another
    /// one of the same settings, which `manage` makes, and how many objects are new.
    ///
    /// # Errors
    /// As [`VeManager::new`].
    pub fn look<E: From<ExecutorError>>(
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
pub struct Hands<'a> {
    script: &'a Script,
}

impl Hands<'_> {
    /// A frame was swapped: posts what the hands do two frames later.
    pub fn swapped(&self, frame: u64, mailbox: &Mailbox) {
        self.script.post(frame, mailbox);
    }
}

/// A renderer that keeps the score of what it is shown.
pub struct Watch<'a> {
    renderer: &'a mut dyn Renderer,
    head: &'a Head,
    score: &'a mut Score,
}

impl Renderer for Watch<'_> {
    fn draw(&mut self, object: &Object) {
        if let Some(hand) = TOOLS.iter().position(|&tool| tool == object.id()) {
            self.score.note(hand, object, |place| self.head.inner_at(place) - place.length());
        }
        self.renderer.draw(object);
    }

    fn swap(&mut self, frame: u64) {
        self.score.frame();
        self.renderer.swap(frame);
    }
}

/// The box around the planned opening, through the skull.
fn region(head: &Head) -> Bounds {
    let places = head
        .plan
        .craniotomy
        .iter()
        .flat_map(|&Entry { point, inward, thickness }| [point, point + inward * thickness]);
    let around = places
        .fold(Bounds::EMPTY, |bounds, place| bounds.union(&Bounds { min: place, max: place }));
    around.inflated(MARGIN)
}
