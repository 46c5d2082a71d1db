//! What drawing costs whoever holds the token, and executors with every frame drawn.
//!
//! `cargo bench -p dualframe-render-wgpu --bench drawing`; `-- --test` for a short run.

use std::alloc::System;
use std::error::Error;
use std::thread;
use std::time::{Duration, Instant};

use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::renderer::{OFFSCREEN_FORMAT, Offscreen, Painter};
use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::Object;
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::ParticleScene;
use dualframe_sim::stages;
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};
use wgpu::{PollType, TextureUsages};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Pictures' width and height, in pixels: small, so that an adapter in software leaves time to measure.
const SIZE: (u32, u32) = (320, 180);
/// How long threads may spin on after a run.
const SETTLE: Duration = Duration::from_millis(30);

/// How much is measured.
struct Plan {
    rounds: usize,
    frames: u64,
    objects: &'static [usize],
}

fn main() -> Result<(), Box<dyn Error>> {
    let is_test = std::env::args().any(|argument| argument == "--test");
    let plan = match is_test {
        true => Plan { rounds: 1, frames: 4, objects: &[20] },
        false => Plan { rounds: 9, frames: 40, objects: &[100, 300, 1_000] },
    };
    let gpu = Gpu::new(None)?;
    println!("{}, {} by {} pixels", gpu.title(), SIZE.0, SIZE.1);
    token_time(gpu, if is_test { 20 } else { 500 }, plan.frames)?;
    for &objects in plan.objects {
        executors(&plan, objects)?;
    }
    Ok(())
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Milliseconds of a frame under the token, beside those of a serial frame without drawing.
fn token_time(gpu: Gpu, objects: usize, frames: u64) -> Result<(), Box<dyn Error>> {
    let scene = ParticleScene::new(objects);
    let look = Look::room(scene.room(), Quality::Fast);
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: SIZE.0, height: SIZE.1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: OFFSCREEN_FORMAT,
        usage: TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let picture = texture.create_view(&Default::default());
    let mut painter = Painter::new(gpu, look, OFFSCREEN_FORMAT, SIZE)?;
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    let mut manager = VeManager::new(scene.build()?, settings)?;
    let (mut adding, mut painting, mut working) = (Vec::new(), Vec::new(), Vec::new());
    let mut allocations = 0;
    for frame in 0..frames {
        let began = Instant::now();
        manager.run(1, &mut NullRenderer::new(), &mut |_| ())?;
        working.push(began.elapsed().as_secs_f64() * 1e3);
        let (began, mut before) = (Instant::now(), None);
        let mut add = Add(&mut painter);
        manager.visit(&mut |object| {
            stages::draw(object, &mut add);
            // With the first object the device's library takes memory for the frame.
            before.get_or_insert_with(|| ALLOCATOR.stats().allocations);
        });
        adding.push(began.elapsed().as_secs_f64() * 1e3);
        if frame > frames / 2 {
            allocations += ALLOCATOR.stats().allocations - before.unwrap_or(0);
        }
        let began = Instant::now();
        let mut encoder = painter.gpu().device.create_command_encoder(&Default::default());
        painter.paint(&mut encoder, &picture);
        painter.gpu().queue.submit([encoder.finish()]);
        painting.push(began.elapsed().as_secs_f64() * 1e3);
        painter.gpu().device.poll(PollType::wait_indefinitely())?;
    }
    let [adding, painting, working] =
        [adding, painting, working].map(|mut times| median(&mut times));
    let token = adding + painting;
    println!(
        "{objects} objects: under the token {token:.3} ms a frame (taking them {adding:.3}, encoding and \
         submitting {painting:.3}), {:.1} % of the frame's work; {allocations} allocations of ours",
        100.0 * token / (token + working)
    );
    Ok(())
}

/// Takes objects and ends no frame.
struct Add<'a>(&'a mut Painter);

impl Renderer for Add<'_> {
    fn draw(&mut self, object: &Object) {
        self.0.add(object);
    }

    fn swap(&mut self, _: u64) {}
}

/// Frames per second of each executor with every frame drawn.
fn executors(plan: &Plan, objects: usize) -> Result<(), Box<dyn Error>> {
    let kinds = [
        ExecutorKind::Pipeline,
        ExecutorKind::RayonOverlapped,
        ExecutorKind::Rayon,
        ExecutorKind::Static,
        ExecutorKind::Serial,
    ];
    let scene = ParticleScene::new(objects);
    let mut rates = vec![Vec::new(); kinds.len()];
    let mut states = Vec::new();
    for round in 0..plan.rounds {
        for turn in 0..kinds.len() {
            let index = (round + turn) % kinds.len();
            let settings = Settings { executor: kinds[index], ..Settings::default() };
            let mut manager = VeManager::new(scene.build()?, settings)?;
            let look = Look::room(scene.room(), Quality::Fast);
            let mut offscreen = Offscreen::new(Gpu::new(None)?, look, SIZE)?;
            manager.run(plan.frames / 4, &mut offscreen, &mut |_| ())?;
            let began = Instant::now();
            manager.run(plan.frames, &mut offscreen, &mut |_| ())?;
            rates[index].push(plan.frames as f64 / began.elapsed().as_secs_f64());
            states.push((manager.state_hash(), offscreen.picture()?));
            drop((manager, offscreen));
            thread::sleep(SETTLE);
        }
        if states.iter().any(|state| *state != states[0]) {
            return Err("executors differ in their states or pictures".into());
        }
        states.truncate(1);
    }
    println!("{objects} objects, every frame drawn:   frames/s   pipeline over it");
    for (kind, own) in kinds.iter().zip(&rates) {
        let mut ratios: Vec<f64> = rates[0].iter().zip(own).map(|(ours, own)| ours / own).collect();
        let rate = median(&mut own.clone());
        println!("{:>28} {rate:14.1} {:18.3}", kind.name(), median(&mut ratios));
    }
    Ok(())
}
