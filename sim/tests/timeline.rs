//! Timelines: what executors record, what a full track keeps, and the trace.

mod common;

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use common::{executors, particles, run};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, Executor, PipelineExecutor, Stage};
use dualframe_sim::pool::Pool;
use dualframe_sim::timeline::{Span, Timeline};
use serde_json::Value;

const FRAMES: u64 = 40;
/// Frames before the timeline is there.
const UNSEEN: u64 = 7;
const THREADS: usize = 2;
/// One worker more than there are threads: some executors render on another one.
const WORKERS: usize = THREADS + 1;
/// More spans than all frames have.
const SPANS: usize = 1 << 15;

fn all_spans(timeline: &Timeline) -> Vec<Vec<Span>> {
    let spans = |worker| {
        let mut spans = Vec::new();
        timeline.copy_since(worker, Duration::ZERO, &mut spans);
        spans
    };
    (0..timeline.workers()).map(spans).collect()
}

fn pipeline(entry: Entry, threads: usize) -> PipelineExecutor {
    let pool = Arc::new(Pool::new(threads, false));
    let scene = particles(100, true, true);
    PipelineExecutor::new(scene, Grain::Spatial, entry, pool).expect("the scene is well formed")
}

fn watched(executor: &mut dyn Executor, frames: u64) -> Arc<Timeline> {
    let timeline = Arc::new(Timeline::new(WORKERS, SPANS));
    executor.watch(Arc::clone(&timeline));
    run(executor, frames);
    timeline
}

#[test]
fn every_frame_shows_every_stage() {
    for (name, mut executor) in executors(|| particles(100, true, true), Grain::Spatial, THREADS) {
        run(&mut *executor, UNSEEN);
        let timeline = watched(&mut *executor, 5);
        run(&mut *executor, FRAMES - UNSEEN - 5);
        let spans = all_spans(&timeline);
        let seen: HashSet<_> =
            spans.iter().flatten().map(|span| (span.frame(), span.stage())).collect();
        let frames = UNSEEN..FRAMES;
        let all = frames.flat_map(|frame| Stage::ALL.map(|stage| (frame, stage))).collect();
        assert_eq!(seen, all, "{name}");
        let end = timeline.now();
        for track in spans {
            assert!(track.len() < SPANS, "{name}: the first frames may be lost");
            assert!(track.iter().all(|span| span.begin() <= span.end() && span.end() <= end));
            assert!(track.is_sorted_by(|a, b| a.end() <= b.begin()), "{name}: spans overlap");
        }
    }
}

#[test]
fn spans_without_a_gap_differ() {
    let timeline = watched(&mut pipeline(Entry::AfterUpdate, THREADS), FRAMES);
    let work = |span: &Span| (span.frame(), span.stage());
    let mut adjacent = 0;
    for track in all_spans(&timeline) {
        for pair in track.windows(2).filter(|pair| pair[0].end() == pair[1].begin()) {
            assert_ne!(work(&pair[0]), work(&pair[1]), "one span is recorded as two");
            adjacent += 1;
        }
    }
    assert!(adjacent > 0, "nothing was tested");
}

/// Whether some frame begins before the one before it has ended.
fn frames_overlap(timeline: &Timeline, frames: u64) -> bool {
    let spans = all_spans(timeline).concat();
    let of = |frame| spans.iter().filter(move |span| span.frame() == frame);
    (1..frames).any(|frame| {
        let begin = of(frame).map(Span::begin).min().expect("all frames were recorded");
        of(frame - 1).any(|span| span.end() > begin)
    })
}

#[test]
fn two_frames_in_flight_are_visible() {
    for threads in 1..=2 {
        let two = watched(&mut pipeline(Entry::AfterUpdate, threads), FRAMES);
        assert!(frames_overlap(&two, FRAMES), "{threads} threads");
    }
    let one = watched(&mut pipeline(Entry::AfterSwap, 1), FRAMES);
    assert!(!frames_overlap(&one, FRAMES));
}

#[test]
fn results_are_the_same() {
    let scene = || particles(100, true, true);
    let alone = executors(scene, Grain::Spatial, THREADS);
    let watched = executors(scene, Grain::Spatial, THREADS);
    for ((name, mut alone), (_, mut watched)) in alone.zip(watched) {
        watched.watch(Arc::new(Timeline::new(1, 10)));
        let ((counts, hash, _), (same_counts, same_hash, _)) =
            (run(&mut *alone, FRAMES), run(&mut *watched, FRAMES));
        assert_eq!((counts, hash), (same_counts, same_hash), "{name}");
    }
}

const MICROSECOND: Duration = Duration::from_micros(1);

/// Records the span that belongs to a frame: 10 µs after the one before, 0 to 9 µs long.
fn record(timeline: &Timeline, start: Instant, frame: u32) {
    let begin = start + frame * 10 * MICROSECOND;
    let end = begin + frame % 10 * MICROSECOND;
    timeline.record(0, stage_of(frame.into()), frame.into(), begin, end);
}

fn stage_of(frame: u64) -> Stage {
    Stage::ALL[(frame % 4) as usize]
}

fn frames(spans: &[Span]) -> Vec<u64> {
    spans.iter().map(Span::frame).collect()
}

#[test]
fn a_full_track_loses_its_oldest_spans() {
    let timeline = Timeline::new(1, 4);
    let start = Instant::now();
    (0..3).for_each(|frame| record(&timeline, start, frame));
    assert_eq!(frames(&all_spans(&timeline)[0]), [0, 1, 2]);
    (3..14).for_each(|frame| record(&timeline, start, frame));
    assert_eq!(frames(&all_spans(&timeline)[0]), [10, 11, 12, 13]);

    let mut recent = all_spans(&timeline)[0].clone();
    let end = recent[2].end();
    timeline.copy_since(0, end, &mut recent);
    assert_eq!(frames(&recent), [10, 11, 12, 13, 12, 13], "what was there stays");
    timeline.copy_since(0, end + MICROSECOND, &mut recent);
    assert_eq!(frames(&recent[6..]), [13]);
}

#[test]
fn limits() {
    let (now, later) = (Instant::now(), Instant::now() + MICROSECOND);
    let none = Timeline::new(0, 10);
    none.record(0, Stage::Update, 0, now, later);
    none.copy_since(0, Duration::ZERO, &mut Vec::new());
    let empty = Timeline::new(1, 0);
    empty.record(0, Stage::Update, 0, now, later);
    empty.record(1, Stage::Update, 0, now, later);
    assert_eq!(all_spans(&empty), [[]]);
    // A time before the start, an end before its begin, a frame after centuries.
    let timeline = Timeline::new(1, 2);
    timeline.record(0, Stage::Render, u64::MAX >> 2, now, now);
    timeline.record(0, Stage::Update, 1, later, now);
    let spans = &all_spans(&timeline)[0];
    assert_eq!((spans[0].begin(), spans[0].end()), (Duration::ZERO, Duration::ZERO));
    assert_eq!((spans[0].stage(), spans[0].frame()), (Stage::Render, u64::MAX >> 2));
    assert_eq!(spans[1].begin(), spans[1].end());
}

#[test]
fn readers_see_whole_spans_in_order() {
    const KEPT: usize = 500;
    const READS: usize = 20_000;
    /// Far more than are written during the reads, unless the two threads never run at the same time.
    const MOST: u32 = 400_000_000;
    let timeline = Timeline::new(1, KEPT);
    let start = Instant::now();
    let (mut reads, mut was_full, mut cut_short, mut offset) = (0, false, 0, None);
    let is_read = AtomicBool::new(false);
    thread::scope(|scope| {
        let writer = scope.spawn(|| {
            let going = |_: &u32| !is_read.load(Ordering::Relaxed);
            (0..MOST).take_while(going).for_each(|frame| record(&timeline, start, frame));
        });
        let mut spans = Vec::with_capacity(KEPT);
        while (reads < READS || cut_short == 0) && !writer.is_finished() {
            spans.clear();
            reads += 1;
            timeline.copy_since(0, Duration::ZERO, &mut spans);
            // Once it has been full it stays so: what is missing then was overwritten.
            was_full |= spans.len() == KEPT;
            cut_short += usize::from(was_full && spans.len() < KEPT);
            for span in &spans {
                let frame = span.frame() as u32;
                assert_eq!(span.stage(), stage_of(span.frame()));
                assert_eq!(span.end() - span.begin(), frame % 10 * MICROSECOND);
                let start = span.begin() - frame * 10 * MICROSECOND;
                assert_eq!(start, *offset.get_or_insert(start), "another frame's begin");
            }
            assert!(spans.is_sorted_by(|a, b| a.frame() + 1 == b.frame()), "a frame is missing");
        }
        is_read.store(true, Ordering::Relaxed);
    });
    assert!(cut_short > 0, "nothing was overwritten while it was read");
}

/// The number in a field of an event, in microseconds.
fn microseconds(event: &Value, field: &str) -> Duration {
    let number = event[field].as_f64().expect("a number");
    Duration::from_nanos((number * 1e3).round() as u64)
}

#[test]
fn the_trace_says_the_same() {
    let timeline = watched(&mut pipeline(Entry::AfterUpdate, THREADS), FRAMES);
    let end = timeline.now();
    let mut trace = Vec::new();
    timeline.write_chrome_trace(&mut trace).expect("memory takes everything");
    let trace: Value = serde_json::from_slice(&trace).expect("JSON");
    let mut events = trace["traceEvents"].as_array().expect("a list").iter().peekable();
    for (worker, track) in all_spans(&timeline).iter().enumerate().filter(|(_, t)| !t.is_empty()) {
        let name = events.next().expect("an event");
        assert_eq!((&name["ph"], &name["name"]), (&"M".into(), &"thread_name".into()));
        assert_eq!(name["args"]["name"], format!("worker {worker}"));
        for (span, event) in track.iter().zip(&mut events) {
            let name = ["broad phase", "interaction", "update", "render"][span.stage() as usize];
            assert_eq!((&event["ph"], &event["name"]), (&"X".into(), &name.into()));
            assert_eq!((&event["pid"], &event["tid"]), (&1.into(), &worker.into()));
            assert_eq!(event["cat"], ["even", "odd"][(span.frame() % 2) as usize]);
            assert_eq!(event["args"]["frame"], span.frame());
            let (begin, length) = (microseconds(event, "ts"), microseconds(event, "dur"));
            assert_eq!((begin, begin + length), (span.begin(), span.end()));
            assert!(begin + length <= end, "outside the run");
        }
    }
    assert_eq!(events.next(), None);
}

#[test]
fn a_trace_of_nothing_is_json() {
    let mut trace = Vec::new();
    Timeline::new(2, 10).write_chrome_trace(&mut trace).expect("memory takes everything");
    let trace: Value = serde_json::from_slice(&trace).expect("JSON");
    assert_eq!(trace["traceEvents"], Value::Array(Vec::new()));
}
