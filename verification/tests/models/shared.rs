//! A renderer that is left to all workers: one has it at a time, and no rendering is left over.
//!
//! A worker that sleeps for ever, or a rendering that nobody comes for, exceeds loom's limit of branches.

use super::ve::{Patience, Piped, Setup, World, build, step, verify};
use super::{Model, Role, check, together};
use dualframe_core_model::frame::Entry;
use dualframe_core_model::stage::Stage;
use dualframe_core_model::wait::Spin;
use dualframe_core_model::worker::{Step, Worker};

pub(crate) const ALL: &[Model] = &[
    ("shared::leaver_calls", leaver_calls),
    ("shared::sleepers_end", sleepers_end),
    ("shared::busy_after_it", busy_after_it),
    ("shared::all_rendered_meanwhile", all_rendered_meanwhile),
];

/// Two units that do not interact, one at each worker's home, and a renderer left to both workers.
const SHARED: Setup = Setup { solitary_from: 0, frames: 1, shared: true, ..Setup::DEFAULT };

/// Two workers who wait before every step. How many units each rendered, when both have come to an end.
fn rendered(setup: Setup, order: usize) -> [u32; 2] {
    let (pipeline, world) = build(setup);
    let role = |home: u32| -> Role<u32> {
        Box::new(move || {
            let mut worker = pipeline.worker_at(home);
            let mut rendered = 0;
            while !pipeline.finished() {
                worker.wait();
                let did = step(&mut worker, world);
                rendered += u32::from(did == Step::Worked(Stage::Render));
            }
            rendered
        })
    };
    let rendered = together(order, vec![role(0), role(1)]);
    verify(pipeline, world);
    [rendered[0], rendered[1]]
}

/// Both come to an end. The outcome is how many units each rendered: one that another is about to render may be
/// rendered by that one too.
fn sleepers_end() {
    check("shared::sleepers_end", Some(2), 2, [[0, 2], [1, 1], [2, 0]], |order| {
        rendered(SHARED, order)
    });
}

/// Whoever puts the renderer back may go on with work that takes long, here with unit 0's entry into frame 1, until
/// unit 1 is rendered: of a rendering that was queued meanwhile somebody knows who is awake. The outcome is how many
/// units each rendered.
fn busy_after_it() {
    let each = (0..=4).map(|rendered| [rendered, 4 - rendered]);
    check("shared::busy_after_it", Some(1), 2, each, |order| {
        let entry = Entry::AfterRender;
        let patience = Patience::Entry;
        let setup = Setup { far: true, entry, shared: true, patience, ..Setup::DEFAULT };
        rendered(setup, order)
    });
}

/// Steps until the end, and sleeps where there is nothing to do. How many units it rendered.
fn stay(pipeline: &Piped<Spin>, world: &World, mut worker: Worker<'static, 'static, World>) -> u32 {
    let mut rendered = 0;
    while !pipeline.finished() {
        match step(&mut worker, world) {
            Step::Idle => worker.wait(),
            did => rendered += u32::from(did == Step::Worked(Stage::Render)),
        }
    }
    rendered
}

/// A worker sees a rendering, of unit 0, and takes the renderer when the other one has rendered that: it may go on with
/// work that takes long, here with unit 1's update, until unit 3 is rendered, which the other one updates. The outcome is
/// how many units each rendered.
fn all_rendered_meanwhile() {
    check("shared::all_rendered_meanwhile", Some(2), 2, [[0, 4], [1, 3]], |order| {
        let setup = Setup { units: 4, patience: Patience::Update, ..SHARED };
        let (pipeline, world) = build(setup);
        let [mut one, mut other] = [0, 1].map(|home| pipeline.worker_at(home));
        // All enter the frame; the other one, with unit 2 to render, has the renderer when unit 0 is updated, by a worker
        // that leaves and so cannot keep the rendering.
        (0..setup.units).for_each(|_| _ = step(&mut one, world));
        assert_eq!(step(&mut other, world), Step::Worked(Stage::Update));
        let mut leaver = pipeline.worker_at(0);
        assert_eq!(step(&mut leaver, world), Step::Worked(Stage::Update));
        drop(leaver);
        let role = |worker| -> Role<u32> { Box::new(move || stay(pipeline, world, worker)) };
        let rendered = together(order, vec![role(one), role(other)]);
        verify(pipeline, world);
        [rendered[0], rendered[1]]
    });
}

/// One worker leaves after some steps, with the renderer or without, and with what it carries; the other one, who
/// sleeps where it finds nothing to do, comes to the end. The outcome is how many units that one rendered.
fn leaver_calls() {
    check("shared::leaver_calls", Some(1), 10, [0, 1, 2], |order| {
        let (pipeline, world) = build(SHARED);
        let leave: Role<u32> = Box::new(move || {
            let mut worker = pipeline.worker_at(0);
            (0..order / 2).for_each(|_| _ = step(&mut worker, world));
            0
        });
        let staying: Role<u32> = Box::new(|| stay(pipeline, world, pipeline.worker_at(1)));
        let rendered = together(order, vec![leave, staying])[1];
        verify(pipeline, world);
        rendered
    });
}
