//! Tiny experiments: what they write, and that it is whole.
#![cfg(feature = "experiment")]
#![forbid(unsafe_code)]

use std::fs;

use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::experiment::error::ExperimentError;
use dualframe_sim::experiment::plan::{Plan, Retraction, Sweep};
use dualframe_sim::experiment::race::Runner;
use dualframe_sim::experiment::subject::Subject;
use dualframe_sim::experiment::{Experiment, Findings, PAGE, run};
use dualframe_sim::manager::VeManager;
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::ParticleScene;
use dualframe_sim::scene::craniotomy::{OBJECTS, TOOLS};
use glam::Vec3;

fn tiny() -> Plan {
    let sweep = |objects: &[usize], rounds| Sweep { objects: objects.to_vec(), frames: 5, rounds };
    Plan {
        seed: 3,
        threads: vec![1, 2],
        scalability: sweep(&[3, 6], 2),
        load_balance: sweep(&[4, 500], 2),
        per_frame: sweep(&[5], 2),
        compare: sweep(&[3, 5], 2),
        retraction: Retraction { threads: vec![1, 2], keeps_core: true, frames: 2, rounds: 1 },
    }
}

#[test]
fn all_experiments() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let plan = tiny();
    let mut work = 0;
    let found = run(&Experiment::ALL, &plan, out.path(), &mut |_, done| work += done);
    let Findings { reports, written, ended } = found.expect("the plan is sound");
    written.expect("the folder takes them");
    ended.expect("tiny experiments run");
    let all: u64 = Experiment::ALL.iter().map(|experiment| experiment.work(&plan)).sum();
    assert_eq!(work, all, "progress ends where it should");

    let read = |name: &str| fs::read_to_string(out.path().join(name)).expect("it was written");
    let rows = |name: &str| {
        let text = read(name);
        let mut lines = text.lines().map(|line| line.split(',').count());
        let columns = lines.next().expect("a header");
        assert!(lines.all(|cells| cells == columns), "{name}");
        text.lines().count() - 1
    };
    let runners = 1 + 2 * (ExecutorKind::ALL.len() - 1);
    assert_eq!(rows("scalability-rounds.csv"), 2 * 2 * 3);
    assert_eq!(rows("load-balance.csv"), 2 * 2);
    assert_eq!(rows("load-balance-rounds.csv"), 2 * 2 * 2);
    assert_eq!(rows("per-frame.csv"), 5);
    assert_eq!(rows("per-frame-summary.csv"), 2);
    assert_eq!(rows("per-frame-rounds.csv"), 2 * 2);
    // Beside those with rendering the serial version is timed without.
    assert_eq!(rows("compare-rounds.csv"), 2 * 2 * (2 * runners + 1));
    assert_eq!(rows("compare-craniotomy-rounds.csv"), 2 * runners + 1);
    // Over all rounds there is a row for each; over the good ones, if there are any.
    assert!((2 * 3..=2 * 2 * 3).contains(&rows("scalability.csv")));
    assert!((4 * runners..=2 * 4 * runners).contains(&rows("compare.csv")));
    assert!((2 * runners..=2 * 2 * runners).contains(&rows("compare-craniotomy.csv")));

    let page = read(PAGE);
    let figures: Vec<_> = reports.iter().flat_map(|report| &report.figures).collect();
    assert_eq!(figures.len(), 3 + 1 + 2 + 4 + 2);
    for figure in figures {
        assert_eq!(read(&format!("{}.svg", figure.name)), figure.svg);
        let png =
            fs::read(out.path().join(format!("{}.png", figure.name))).expect("it was written");
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n", "{}", figure.name);
        let drawing = &figure.svg[figure.svg.find("<svg").expect("an SVG")..];
        assert!(page.contains(drawing), "{} is in the page", figure.name);
        assert!(!figure.finding.is_empty() && !figure.paper.is_empty(), "{}", figure.name);
    }
    for outside in ["src=", "href=", "url(http", "@import", "<script", "<link"] {
        assert!(!page.contains(outside), "{outside}: the page needs nothing else");
    }
    assert!(page.contains("seed 3"));
    assert!(page.contains("Table 1: seconds that each worker worked per stage over "));
    assert!(page.contains("draws on it. Frames 65 to 66 of the "));
    assert_eq!(page.matches("Frames 65 to 69, 2 rounds of each size. ").count(), 3);
    assert_eq!(page.matches("Frames 65 to 69. ").count(), 4);
}

#[test]
fn a_folder_that_is_not_there() {
    let out = std::path::Path::new("/no/such/folder");
    let error = run(&[Experiment::PerFrame], &tiny(), out, &mut |_, _| ()).err();
    assert!(error.is_some_and(|error| error.to_string().contains("/no/such/folder")));
}

#[test]
fn a_file_that_cannot_be_written_costs_no_other() {
    let out = tempfile::tempdir().expect("a temporary folder");
    // A folder stands in its place.
    fs::create_dir(out.path().join("fig15-collisions.svg")).expect("a folder");
    let experiments = [Experiment::PerFrame, Experiment::Compare];
    let found = run(&experiments, &tiny(), out.path(), &mut |_, _| ());
    let Findings { reports, written, ended } = found.expect("the plan is sound");
    ended.expect("tiny experiments run");
    let error = written.expect_err("it cannot be written");
    assert!(error.to_string().contains("fig15-collisions.svg"), "{error}");
    assert_eq!(reports.len(), 2);
    for name in ["fig15-collisions.png", "fig15-speed-up.svg", "compare.csv", PAGE] {
        assert!(out.path().join(name).is_file(), "{name}");
    }
}

#[test]
fn an_experiment_that_fails_costs_no_earlier_one() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let compare = Sweep { objects: vec![3, ParticleScene::MAX_OBJECTS + 1], ..tiny().compare };
    let plan = Plan { compare, ..tiny() };
    let experiments = [Experiment::PerFrame, Experiment::Compare, Experiment::LoadBalance];
    let found = run(&experiments, &plan, out.path(), &mut |_, _| ());
    let Findings { reports, written, ended } = found.expect("the first one runs");
    assert!(matches!(ended, Err(ExperimentError::Scene(_))), "{ended:?}");
    assert!(written.is_ok() && out.path().join("per-frame.csv").is_file());
    assert_eq!(reports.len(), 1);
}

#[test]
fn a_plan_that_lacks_something() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let plan = tiny();
    let sweep =
        |sweep: &Sweep, objects: &[usize]| Sweep { objects: objects.to_vec(), ..sweep.clone() };
    let wrong = [
        Plan { per_frame: sweep(&plan.per_frame, &[]), ..tiny() },
        Plan { per_frame: sweep(&plan.per_frame, &[5, 6]), ..tiny() },
        Plan { per_frame: Sweep { rounds: 0, ..plan.per_frame.clone() }, ..tiny() },
        Plan { compare: sweep(&plan.compare, &[3]), ..tiny() },
        Plan { compare: Sweep { frames: 0, ..plan.compare.clone() }, ..tiny() },
        Plan { load_balance: sweep(&plan.load_balance, &[]), ..tiny() },
        Plan { load_balance: Sweep { rounds: 0, ..plan.load_balance.clone() }, ..tiny() },
        Plan { threads: vec![], ..tiny() },
        Plan { threads: vec![2], ..tiny() },
    ];
    for plan in wrong {
        let experiments = [Experiment::LoadBalance, Experiment::PerFrame, Experiment::Compare];
        let error = run(&experiments, &plan, out.path(), &mut |_, _| ()).err();
        assert!(matches!(error, Some(ExperimentError::Plan { .. })), "{plan:?}: {error:?}");
    }
}

/// Where the right hand is.
fn right_hand(manager: &VeManager) -> Vec3 {
    let mut place = None;
    manager.visit(&mut |object| {
        if object.id() == TOOLS[0] {
            place = Some(object.center());
        }
    });
    place.expect("a tool")
}

#[test]
fn a_retraction_is_of_thirty_objects_and_moves_its_hands() {
    let subject = Subject::retraction().expect("a head");
    let mut session = subject.start(Runner::SERIAL).expect("a valid environment");
    let mut objects = 0;
    session.manager.visit(&mut |_| objects += 1);
    assert_eq!((objects, subject.objects(), OBJECTS), (30, 30, 30));
    let before = right_hand(&session.manager);
    session.run(30, &mut NullRenderer::new(), &mut |_| ()).expect("it runs");
    // The scalpel is brought to the skin at 0.1 m/s.
    let way = before.distance(right_hand(&session.manager));
    assert!(way > 0.02, "the right hand moved by {way} m");
    assert!(subject.script_frames() > 30);
}
