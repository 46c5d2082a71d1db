//! What single arguments may be.

use dualframe_sim::device::thread::{MAX_RATE, MIN_RATE};
use dualframe_sim::executor::{ExecutorKind, MAX_THREADS};
use dualframe_sim::scene::ParticleScene;
use dualframe_sim::scene::craniotomy::Step;
use dualframe_sim::simd::{Instructions, Simd};

/// The greatest width and height that may be asked for; adapters usually allow 8,192 or 16,384.
const MAX_PIXELS: u32 = 16_384;
/// Executors that a program built without them still knows by name.
const NATIVE_PEERS: [&str; 4] = ["openmp-static", "openmp-dynamic", "tbb-for", "tbb-pipeline"];

pub(super) fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (MIN_RATE..=MAX_RATE).contains(rate));
    rate.ok_or_else(|| format!("not a number from {MIN_RATE} to {MAX_RATE}"))
}

pub(super) fn parse_step(text: &str) -> Result<Step, String> {
    let known = Step::ALL.into_iter().find(|step| step.name() == text);
    known.ok_or_else(|| format!("not one of {}", Step::ALL.map(Step::name).join(", ")))
}

pub(super) fn parse_objects(text: &str) -> Result<usize, String> {
    parse_number(text, ParticleScene::MAX_OBJECTS)
}

pub(super) fn parse_threads(text: &str) -> Result<usize, String> {
    parse_number(text, MAX_THREADS)
}

pub(super) fn parse_executor(text: &str) -> Result<ExecutorKind, String> {
    let known = ExecutorKind::ALL.iter().find(|kind| kind.name() == text);
    known.copied().ok_or_else(|| {
        if NATIVE_PEERS.contains(&text) {
            "this program was built without the feature `native-peers`".to_owned()
        } else {
            format!("there are {}", executor_names())
        }
    })
}

pub(super) fn executor_names() -> String {
    let names: Vec<_> = ExecutorKind::ALL.iter().map(|kind| kind.name()).collect();
    names.join(", ")
}

pub(super) fn parse_number(text: &str, most: usize) -> Result<usize, String> {
    let number = text.parse().ok().filter(|number| (1..=most).contains(number));
    number.ok_or_else(|| format!("not a whole number from 1 to {most}"))
}

pub(super) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').ok_or("not like 1280x720")?;
    let pixels = |text: &str| text.parse().ok().filter(|pixels| (1..=MAX_PIXELS).contains(pixels));
    pixels(width)
        .zip(pixels(height))
        .ok_or_else(|| format!("not two whole numbers from 1 to {MAX_PIXELS}"))
}

pub(super) fn parse_simd(text: &str) -> Result<Simd, String> {
    let named = Instructions::ALL.into_iter().find(|instructions| instructions.name() == text);
    let instructions = named.ok_or_else(|| {
        format!("not one of {}", Instructions::ALL.map(Instructions::name).join(", "))
    })?;
    Simd::new(instructions).map_err(|lacking| lacking.to_string())
}
