//! Pictures of scenes, and how they are compared.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Coloring, Look, Quality};
use dualframe_render_wgpu::picture::Picture;
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_sim::geometry::Bounds;
use dualframe_sim::manager::{Settings, VeManager};
use dualframe_sim::object::Object;
use dualframe_sim::render::{NullRenderer, Renderer};
use dualframe_sim::scene::{ParticleScene, Scene};
use dualframe_sim::stages;

/// The pictures' width and height, in pixels.
const SIZE: (u32, u32) = (480, 320);
/// The side of the squares in which pictures are compared, in pixels.
const SQUARE: usize = 8;
/// By how much the mean of a square may differ in a channel, of 255; usually 8. Drivers differ by 1 or 2 at the
/// edges of bodies; what must be seen differs by 15 and more.
const TOLERANCE: f32 = 8.0;

fn particles(objects: usize) -> ParticleScene {
    ParticleScene { gravity: true, ..ParticleScene::new(objects) }
}

/// So many particles at their start.
pub(crate) fn scene(objects: usize) -> Scene {
    particles(objects).build().expect("few particles")
}

/// The room of so many particles.
pub(crate) fn room(objects: usize) -> Bounds {
    particles(objects).room()
}

fn offscreen(focus: Bounds, coloring: Coloring) -> Offscreen {
    let gpu = Gpu::new(None).expect("there is a graphics adapter");
    let look = Look { coloring, ..Look::room(focus) };
    Offscreen::new(gpu, look, Quality::Fine, SIZE).expect("a small picture")
}

fn read(offscreen: &Offscreen) -> Picture {
    offscreen.picture().expect("the device does not fail")
}

/// A picture of some objects.
pub(crate) fn draw(objects: &[Object], focus: Bounds, coloring: Coloring) -> Picture {
    let mut offscreen = offscreen(focus, coloring);
    objects.iter().for_each(|object| stages::draw(object, &mut offscreen));
    offscreen.swap(0);
    read(&offscreen)
}

/// A picture of frame number `frame`, counted from 1, of so many particles.
pub(crate) fn after(objects: usize, frame: u64) -> Picture {
    let mut manager =
        VeManager::new(scene(objects), Settings::default()).expect("there are threads");
    let mut offscreen = offscreen(room(objects), Coloring::Object);
    let run = manager.run(frame - 1, &mut NullRenderer::new(), &mut |_| {});
    run.and_then(|()| manager.run(1, &mut offscreen, &mut |_| {})).expect("tables suffice");
    read(&offscreen)
}

/// Whether two pictures show the same, or where they differ.
pub(crate) fn agree(a: &Picture, b: &Picture) -> Result<(), String> {
    if (a.width, a.height) != (b.width, b.height) {
        return Err("they differ in size".to_owned());
    }
    let (width, height) = (a.width as usize, a.height as usize);
    for top in (0..height).step_by(SQUARE) {
        for left in (0..width).step_by(SQUARE) {
            for channel in 0..3 {
                let mean = |picture: &Picture| {
                    let rows = top..height.min(top + SQUARE);
                    let columns = left..width.min(left + SQUARE);
                    let count = (rows.len() * columns.len()) as f32;
                    let at = |y, x| f32::from(picture.pixels[4 * (y * width + x) + channel]);
                    rows.flat_map(|y| columns.clone().map(move |x| (y, x)))
                        .map(|(y, x)| at(y, x))
                        .sum::<f32>()
                        / count
                };
                let (one, other) = (mean(a), mean(b));
                if (one - other).abs() > TOLERANCE {
                    return Err(format!(
                        "at ({left}, {top}), channel {channel}: {one} and {other}"
                    ));
                }
            }
        }
    }
    Ok(())
}

/// Compares a picture with the one kept under this name.
pub(crate) fn golden(name: &str, picture: &Picture) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    let file = file.with_extension("png");
    if std::env::var_os("DUALFRAME_NEW_PICTURES").is_some() {
        picture.save(&file).expect("the folder can be written to");
    }
    if let Err(difference) = agree(picture, &load(&file)) {
        let drawn = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name).with_extension("png");
        picture.save(&drawn).expect("the folder can be written to");
        panic!("{} differs from {}: {difference}", drawn.display(), file.display());
    }
}

fn load(file: &Path) -> Picture {
    let reader = BufReader::new(File::open(file).expect("the picture is kept"));
    let mut reader = png::Decoder::new(reader).read_info().expect("it is a PNG");
    let mut pixels = vec![0; reader.output_buffer_size().expect("it is small")];
    let info = reader.next_frame(&mut pixels).expect("it is whole");
    Picture { width: info.width, height: info.height, pixels }
}
