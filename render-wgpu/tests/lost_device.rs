//! A graphics device that fails in mid-run harms nothing but the pictures.

use std::sync::mpsc::TryRecvError;

use dualframe_render_wgpu::error::GraphicsError;
use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::pick::Pick;
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, ExecutorKind};
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::ParticleScene;
use glam::Vec2;

const FRAMES: u64 = 20;
const LAST_GOOD_FRAME: u64 = 5;

fn particles() -> ParticleScene {
    ParticleScene::new(40)
}

fn manager(executor: ExecutorKind) -> VeManager {
    let (grain, entry) = (Grain::Spatial, Entry::AfterUpdate);
    let settings = Settings { executor, threads: 2, pinned: false, grain, entry };
    let scene = particles().build().expect("the number of particles is allowed");
    VeManager::new(scene, settings).expect("the settings are allowed")
}

#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn the_run_goes_on() {
    for executor in [ExecutorKind::Pipeline, ExecutorKind::Serial, ExecutorKind::RayonOverlapped] {
        let mut undrawn = manager(executor);
        let drawing_nothing = &mut NullRenderer::new();
        undrawn.run(FRAMES, drawing_nothing, &mut |_| {}).expect("it runs");

        let gpu = Gpu::new(None).expect("an adapter");
        let look = Look::room(particles().room());
        let mut offscreen =
            Offscreen::new(gpu, look, Quality::Fast, (320, 200)).expect("the size is allowed");
        let device = offscreen.painter.gpu().device.clone();
        let (auxiliary, mut answers) = (offscreen.painter.auxiliary(), Vec::new());
        let mut drawn = manager(executor);
        let mut frames = 0;
        let on_frame = &mut |_: &_| {
            frames += 1;
            if frames == LAST_GOOD_FRAME {
                device.destroy();
            }
            let (answer, answered) = std::sync::mpsc::channel();
            let pick = Pick::new(Vec2::ZERO, answer);
            auxiliary.submit(Box::new(pick)).expect("the queue takes one a frame");
            answers.push(answered);
        };
        drawn.run(FRAMES, &mut offscreen, on_frame).expect("it runs on");

        assert_eq!(frames, FRAMES);
        assert_eq!(drawn.state_hash(), undrawn.state_hash(), "{executor:?}");
        let failure = offscreen.painter.failure().expect("the device failed");
        assert!(matches!(failure, GraphicsError::Lost { .. }), "{failure:?}");
        assert_eq!(failure.to_string().lines().count(), 1, "{failure}");
        assert_eq!(offscreen.picture(), Err(failure));
        // Whoever asked the device something hears that there will be no answer, with the next frame.
        let asked = answers.len() - 1;
        for answered in &answers[LAST_GOOD_FRAME as usize..asked] {
            assert!(matches!(answered.try_recv(), Err(TryRecvError::Disconnected)));
        }
    }
}

/// What is drawn first on a device that has failed, unnoticed: it has to be made there.
#[test]
#[ignore = "needs a graphics adapter; .ci/run has one"]
fn what_is_new_fails_without_a_panic() {
    let gpu = Gpu::new(None).expect("an adapter");
    let look = Look::room(particles().room());
    let mut offscreen =
        Offscreen::new(gpu, look, Quality::Fast, (320, 200)).expect("the size is allowed");
    let [known, others] =
        [(); 2].map(|()| particles().build().expect("the number of particles is allowed").objects);
    known.iter().for_each(|object| offscreen.draw(object));
    offscreen.swap(0);
    offscreen.draw(&known[0]);
    offscreen.painter.gpu().device.destroy();
    others.iter().for_each(|object| offscreen.draw(object));
    offscreen.swap(1);
    let failure = offscreen.painter.failure().expect("the device failed");
    assert!(matches!(failure, GraphicsError::Lost { .. }), "{failure:?}");
}
