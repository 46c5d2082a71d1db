//! What there may be only so many of at once: tokens, renderers, runs, readers.

use std::sync::atomic::Ordering::SeqCst;

use dualframe_core::error::{NotShared, StillRunning, Table};
use dualframe_core::latest::Latest;
use dualframe_core::pipeline::Config;

use crate::flood::{Flood, Sizes, drive, full};

/// Of one unit, with so many tokens.
fn with_tokens(tokens: u32) -> Sizes {
    let sizes = Sizes::spatial(1, 2, 0, 1);
    Sizes { config: Config { tokens, ..sizes.config }, ..sizes }
}

#[test]
fn as_many_tokens_as_there_are() {
    for tokens in [0, 1, 3] {
        with_tokens(tokens).with(|pipeline| {
            let pipeline = pipeline.expect("tables that fit");
            let capacity = tokens as usize;
            let mut held = vec![];
            for _ in 0..3 {
                held.extend((0..tokens).map(|_| pipeline.token(()).map_err(drop).expect("one")));
                let error = pipeline.token(()).map_err(|((), error)| error).expect_err("all out");
                assert_eq!(error, full(Table::Tokens, capacity, capacity + 1));
                held.clear();
            }
        });
    }
}

#[test]
fn all_tokens_or_a_shared_renderer() {
    for tokens in [0, 1, 3] {
        with_tokens(tokens).with(|pipeline| {
            let mut pipeline = pipeline.expect("tables that fit");
            let capacity = tokens as usize;
            let none_left = Err(((), full(Table::Tokens, capacity, capacity + 1)));
            let not_shared = Err(((), NotShared { tokens }));
            assert_eq!(pipeline.take_back(), None);
            if tokens == 0 {
                assert_eq!(pipeline.share(()), not_shared);
                return;
            }
            assert_eq!(pipeline.share(()), Ok(()));
            assert_eq!(pipeline.token(()).map(drop), none_left);
            assert_eq!(pipeline.share(()), not_shared, "there is one");
            assert_eq!(pipeline.take_back(), Some(()));
            assert_eq!(pipeline.take_back(), None);
            std::mem::forget(pipeline.token(()));
            assert_eq!(pipeline.share(()), not_shared, "one is out");
        });
    }
}

#[test]
fn no_token_of_another_pipeline_and_no_second_one() {
    let sizes = with_tokens(2);
    sizes.with(|ours| {
        sizes.with(|theirs| {
            let (ours, theirs) = (ours.expect("fits"), theirs.expect("fits"));
            let mut worker = ours.worker();
            let foreign = theirs.token(()).map_err(drop).expect("one");
            assert!(worker.hold(foreign).is_err());
            assert!(worker.hold(ours.token(()).map_err(drop).expect("one")).is_ok());
            assert!(worker.hold(ours.token(()).map_err(drop).expect("two")).is_err());
        });
    });
}

#[test]
fn no_run_while_running() {
    Sizes::spatial(2, 6, 0, 1).with(|pipeline| {
        let mut pipeline = pipeline.expect("tables that fit");
        pipeline.run(2).expect("at rest");
        assert_eq!(pipeline.run(1), Err(StillRunning));
        let flood = Flood::default();
        drive(&pipeline, &flood);
        assert_eq!(pipeline.run(0), Ok(()));
        assert!(pipeline.finished(), "no frame was added");
        pipeline.run(1).expect("at rest");
        drive(&pipeline, &flood);
        assert_eq!(flood.swaps.load(SeqCst), 3);
    });
}

#[test]
fn readers_beyond_the_cell() {
    let mut cell = Latest::<u32, 5>::new(1);
    let (mut writer, readers) = cell.split();
    for value in 2..5 {
        let mut held = vec![];
        for _ in 0..3 {
            held.push(readers.reader().expect("room for three"));
        }
        for _ in 0..3 {
            assert_eq!(readers.reader().err(), Some(full(Table::Readers, 3, 4)));
        }
        // A refused reader takes nothing: the writer still finds room, the others still read.
        for _ in 0..20 {
            writer.publish(value);
        }
        assert!(held.iter_mut().all(|reader| reader.read() == value));
    }
}
