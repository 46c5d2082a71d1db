//! Recordings: read event by event, and replayed for a while. Checksums are made right first, or little
//! would get past them.
#![no_main]

use dualframe_sim::executor::ExecutorKind;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::record::{Reader, Replay, Step};
use dualframe_sim::render::NullRenderer;
use dualframe_sim::scene::ParticleScene;
use libfuzzer_sys::{Corpus, fuzz_target};

/// Bytes before the first chunk.
const START: usize = 12;
/// Bytes before a chunk's content; the last four are the checksum.
const HEAD: usize = 14;
/// How far a recording is replayed.
const FRAMES: u64 = 100;

/// Makes the checksums of all whole chunks right.
fn correct(file: &mut [u8]) {
    let (mut place, mut checksum) = (START, 0);
    while let Some(chunk) = file.get_mut(place..).filter(|chunk| chunk.len() >= HEAD) {
        let length = u32::from_le_bytes([chunk[2], chunk[3], chunk[4], chunk[5]]) as usize;
        if chunk.len() - HEAD < length {
            return;
        }
        let mut hasher = crc32fast::Hasher::new_with_initial(checksum);
        hasher.update(&chunk[..HEAD - 4]);
        hasher.update(&chunk[HEAD..HEAD + length]);
        checksum = hasher.finalize();
        chunk[HEAD - 4..HEAD].copy_from_slice(&checksum.to_le_bytes());
        place += HEAD + length;
    }
}

fuzz_target!(|file: &[u8]| -> Corpus {
    let mut file = file.to_owned();
    correct(&mut file);
    let Ok(mut reader) = Reader::new(&file[..]) else { return Corpus::Keep };
    // Whatever it says that it is of.
    let _ = reader.header().scene::<ParticleScene>();
    let read = reader.by_ref().take_while(Result::is_ok).count();
    if read > 10_000 {
        return Corpus::Keep;
    }
    let mut scene = ParticleScene::new(1).build().expect("one particle");
    let mut replay = Replay::new(&file[..]).expect("the header was read");
    replay.begin(&mut scene);
    let settings = Settings { executor: ExecutorKind::Serial, threads: 1, ..Settings::default() };
    let mut manager = VeManager::new(scene, settings).expect("valid settings");
    while manager.frame() < FRAMES {
        let most = FRAMES - manager.frame();
        match replay.advance(&mut manager, most, &mut NullRenderer::new(), &mut |_| {}) {
            Ok(Step::Over) | Err(_) => break,
            Ok(_) => {}
        }
    }
    Corpus::Keep
});
