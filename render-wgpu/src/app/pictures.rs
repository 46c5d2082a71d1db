//! Pictures without a window: of the last frame, or of every one.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::error::GraphicsError;
use dualframe_render_wgpu::gpu::Gpu;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_render_wgpu::picture::Picture;
use dualframe_render_wgpu::renderer::Offscreen;
use dualframe_sim::object::Object;
use dualframe_sim::render::Renderer;

use super::args::Products;
use super::error::RunError;
use super::outputs::Output;
use super::told::Told;

/// Pictures that wait to be written; usually 4.
const WAITING: usize = 4;

/// Draws the frames that pictures are wanted of.
pub(super) struct Pictures<'a> {
    offscreen: Offscreen,
    /// The frame being drawn.
    frame: u64,
    last: u64,
    /// Whether frames are drawn of which no picture is wanted.
    draws_every: bool,
    sequence: Option<Sequence>,
    /// Whether any frame was drawn.
    has_drawn: bool,
    failure: Option<GraphicsError>,
    told: &'a Told,
}

impl<'a> Pictures<'a> {
    /// `None` if no pictures are wanted.
    pub(super) fn new(
        args: &Products,
        frames: u64,
        (look, camera): (Look, Camera),
        told: &'a Told,
    ) -> Result<Option<Self>, RunError> {
        if !args.offscreen && args.frames_out.is_none() && args.picture.is_none() {
            return Ok(None);
        }
        let gpu = Gpu::new(args.adapter.as_deref())?;
        // What is drawn for its speed is drawn as a window would; a picture is to be looked at.
        let is_for_speed = args.offscreen && args.picture.is_none() && args.frames_out.is_none();
        let quality = if is_for_speed && gpu.is_software() { Quality::Fast } else { Quality::Fine };
        let mut offscreen = Offscreen::new(gpu, look, quality, args.size)?;
        offscreen.painter.camera = camera;
        if let Some(folder) = &args.frames_out
            && has_later(folder, frames)
        {
            let folder = folder.display();
            told.note(&format!("{folder}: pictures from frame {frames} on are of an earlier run"));
        }
        let sequence = args.frames_out.as_deref().map(Sequence::new).transpose();
        Ok(Some(Self {
            offscreen,
            frame: 0,
            last: frames - 1,
            draws_every: args.offscreen,
            sequence: sequence?,
            has_drawn: false,
            failure: None,
            told,
        }))
    }

    fn is_wanted(&self) -> bool {
        self.draws_every || self.sequence.is_some() || self.frame == self.last
    }

    /// Writes what is still to be written, the last frame's picture to `picture`; none of a run that was broken off
    /// before any frame was drawn, which would be empty.
    pub(super) fn finish(mut self, picture: Option<&Output>) {
        self.end_sequence();
        if picture.is_some() && !self.has_drawn {
            self.told
                .note("no frame was drawn that there could be a picture of: it is left as it was");
        }
        let picture = picture.filter(|_| self.has_drawn);
        let last = match self.failure.or_else(|| self.offscreen.painter.failure()) {
            Some(failure) => Err(failure.into()),
            None => picture.map_or(Ok(()), |file| write(self.offscreen.picture(), file)),
        };
        self.told.attempt(last);
    }

    fn end_sequence(&mut self) {
        if let Some(sequence) = self.sequence.take() {
            self.told.attempt(sequence.finish());
        }
    }
}

impl Renderer for Pictures<'_> {
    fn draw(&mut self, object: &Object) {
        if self.is_wanted() {
            self.offscreen.draw(object);
        }
    }

    fn swap(&mut self, frame: u64) {
        if self.is_wanted() {
            self.offscreen.swap(frame);
            self.has_drawn = true;
            if let Some(sequence) = &self.sequence
                && self.failure.is_none()
            {
                match self.offscreen.picture() {
                    Ok(picture) => {
                        let is_taken = sequence.add(frame, picture);
                        // Without a writer no more pictures are drawn for it.
                        if !is_taken {
                            self.end_sequence();
                        }
                    }
                    Err(error) => self.failure = Some(error),
                }
            }
        }
        self.frame = frame + 1;
    }
}

/// Writes a picture to a file of the outputs.
pub(super) fn write(
    picture: Result<Picture, GraphicsError>,
    file: &Output,
) -> Result<(), RunError> {
    let picture = picture?;
    file.replace(|writer| picture.write_png(writer))
}

/// The file in `folder` that gets a frame's picture.
pub(super) fn file_of_frame(folder: &Path, frame: u64) -> PathBuf {
    folder.join(format!("frame-{frame:06}.png"))
}

/// The frame whose picture a file is called as one that gets it.
pub(super) fn frame_of(file: &Path) -> Option<u64> {
    let name = file.file_name().and_then(OsStr::to_str)?;
    name.strip_prefix("frame-")?.strip_suffix(".png")?.parse().ok()
}

/// Whether a folder has pictures of frames that a run of so many does not have.
fn has_later(folder: &Path, frames: u64) -> bool {
    // What cannot be read here is told where it is written to.
    let mut files = fs::read_dir(folder).into_iter().flatten().flatten();
    files.any(|file| frame_of(&file.path()).is_some_and(|frame| frame >= frames))
}

/// Pictures on their way to files, written by a thread of their own.
struct Sequence {
    sender: SyncSender<(PathBuf, Picture)>,
    writer: JoinHandle<Result<(), RunError>>,
    folder: PathBuf,
}

impl Sequence {
    fn new(folder: &Path) -> Result<Self, RunError> {
        let (sender, receiver) = sync_channel::<(PathBuf, Picture)>(WAITING);
        let save = |(path, picture): (PathBuf, Picture)| {
            picture.save(&path).map_err(|source| RunError::Write { path, source })
        };
        let thread = thread::Builder::new().name("pictures".to_owned());
        let writer = thread.spawn(move || receiver.iter().try_for_each(save));
        let writer = writer.map_err(RunError::Writer)?;
        Ok(Self { sender, writer, folder: folder.to_owned() })
    }

    /// Whether there is still somebody who writes it.
    fn add(&self, frame: u64, picture: Picture) -> bool {
        self.sender.send((file_of_frame(&self.folder, frame), picture)).is_ok()
    }

    fn finish(self) -> Result<(), RunError> {
        drop(self.sender);
        match self.writer.join() {
            Ok(written) => written,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}
