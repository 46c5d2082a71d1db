//! A scene that no executor could be made of comes back as it was.
#![forbid(unsafe_code)]

#[cfg(unix)]
use std::sync::Mutex;
#[cfg(unix)]
use std::thread;

use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::{Entry, ExecutorError, ExecutorKind, MAX_THREADS, Refused};
use dualframe_sim::manager::{Settings, VeManager};
#[cfg(unix)]
use dualframe_sim::message::Message;
#[cfg(unix)]
use dualframe_sim::object::ObjectId;
#[cfg(unix)]
use dualframe_sim::record::{Header, Recorder};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::{ParticleScene, Scene};

/// Frames before and after.
const FRAMES: u64 = 40;
const SERIAL: Settings = settings(ExecutorKind::Serial, 1);

const fn settings(executor: ExecutorKind, threads: usize) -> Settings {
    Settings { executor, threads, pinned: false, grain: Grain::Spatial, entry: Entry::AfterUpdate }
}

/// A scene that has run for some frames.
fn scene() -> Scene {
    let scene = ParticleScene { gravity: true, ..ParticleScene::new(50) };
    run(scene.build().expect("a valid scene"), SERIAL).into_scene()
}

fn run(scene: Scene, settings: Settings) -> VeManager {
    let mut manager = VeManager::new(scene, settings).expect("valid settings");
    manager.run(FRAMES, &mut NullRenderer::new(), &mut |_| ()).expect("it goes on");
    manager
}

fn refused(scene: Scene, settings: Settings) -> Refused {
    let Err(refused) = VeManager::new(scene, settings) else { panic!("not refused: {settings:?}") };
    *refused
}

#[test]
fn a_number_of_threads_beyond_its_limits() {
    let expected = run(scene(), SERIAL).state_hash();
    for &executor in ExecutorKind::ALL {
        for threads in [0, MAX_THREADS + 1] {
            let Refused { scene, error } = refused(scene(), settings(executor, threads));
            assert!(matches!(error, ExecutorError::Threads { threads: n } if n == threads));
            assert_eq!(scene.frame, FRAMES);
            assert_eq!(run(scene, settings(executor, 2)).state_hash(), expected, "{executor:?}");
        }
    }
}

#[test]
fn objects_that_cannot_be_grouped() {
    let expected = run(scene(), SERIAL).state_hash();
    for &executor in ExecutorKind::ALL {
        let mut scene = scene();
        let missing = scene.objects.remove(20);
        let Refused { mut scene, error } = refused(scene, settings(executor, 2));
        assert!(matches!(error, ExecutorError::Blocking(_)), "{executor:?}: {error}");
        scene.objects.push(missing);
        assert_eq!(run(scene, settings(executor, 2)).state_hash(), expected, "{executor:?}");
    }
}

/// [`threads_that_cannot_be_had`].
#[cfg(unix)]
#[test]
#[ignore = "run by another test, within limits"]
fn without_memory_for_threads() {
    let expected = run(scene(), SERIAL).state_hash();
    for executor in [
        ExecutorKind::Pipeline,
        ExecutorKind::Static,
        ExecutorKind::Rayon,
        ExecutorKind::RayonOverlapped,
    ] {
        let Refused { scene, error } = refused(scene(), settings(executor, MAX_THREADS));
        let is_of_threads = matches!(error, ExecutorError::Spawn(_) | ExecutorError::Pool(_));
        assert!(is_of_threads, "{executor:?}: {error:?}");
        assert_eq!(run(scene, SERIAL).state_hash(), expected, "{executor:?}");
    }
}

/// [`threads_that_cannot_be_had`].
#[cfg(unix)]
#[test]
#[ignore = "run by another test, within limits"]
fn without_memory_for_one_thread_more() {
    let particles = ParticleScene { gravity: true, ..ParticleScene::new(50) };
    let told = |settings: Settings| {
        let scene = particles.build().expect("a valid scene");
        let manager = VeManager::new(scene, settings).expect("as many as there were");
        manager.mailbox().post(ObjectId(7), Message::Remove);
        manager
    };
    let expected = run(told(SERIAL).into_scene(), SERIAL).state_hash();
    // Those that were joined are gone, which a pool's may be only later.
    let gate = Mutex::new(());
    let most = thread::scope(|scope| {
        let closed = gate.lock().expect("nobody panics");
        let waits = || thread::Builder::new().spawn_scoped(scope, || drop(gate.lock()));
        let waiting: Vec<_> = std::iter::from_fn(|| waits().ok()).collect();
        drop(closed);
        let most = waiting.len();
        waiting.into_iter().for_each(|thread| thread.join().expect("it only waits"));
        most
    });
    // With all that there can be in its pool, nobody is left to compute beside who renders.
    let settings = settings(ExecutorKind::RayonOverlapped, most);
    let mut manager = told(settings);
    let ran = manager.run(FRAMES, &mut NullRenderer::new(), &mut |_| ());
    assert!(matches!(ran, Err(ExecutorError::Spawn(_))), "{most} threads: {ran:?}");
    assert!(ran.is_err_and(|error| error.can_go_on()));
    // What came from outside has not been taken, and can be recorded.
    let mut manager = VeManager::new(manager.into_scene(), SERIAL).expect("valid settings");
    let recorder = Recorder::begin(Vec::new(), &Header::of(&particles), &manager);
    let mut recorder = recorder.expect("nothing has happened");
    let ran = recorder.run(&mut manager, FRAMES, &mut NullRenderer::new(), &mut |_| ());
    ran.expect("it goes on");
    assert_eq!(manager.state_hash(), expected);
    let (_, totals) = recorder.finish(&manager).expect("there is room");
    assert_eq!(totals.letters, 1);
}

#[cfg(unix)]
#[test]
fn threads_that_cannot_be_had() {
    let test = std::env::current_exe().expect("this one");
    // Some twenty threads' stacks of 1 GiB, and about half of one, in KiB: so that there is memory for all else.
    let script = "ulimit -v 21495808; exec \"$0\" --ignored --exact \"$1\"";
    for limited in ["without_memory_for_threads", "without_memory_for_one_thread_more"] {
        let child = std::process::Command::new("sh")
            .args(["-c".as_ref(), script.as_ref(), test.as_os_str(), limited.as_ref()])
            .envs([("RUST_MIN_STACK", "1073741824"), ("MALLOC_ARENA_MAX", "1")])
            .output()
            .expect("there is a shell");
        let said = String::from_utf8_lossy(&child.stdout);
        assert!(child.status.success() && said.contains("1 passed"), "{child:?}");
    }
}
