//! The graphics device and how it is chosen.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{
    Adapter, AdapterInfo, Backends, Buffer, BufferDescriptor, BufferUsages, Device,
    DeviceDescriptor, DownlevelFlags, Instance, InstanceDescriptor, Limits, PollType,
    PowerPreference, Queue, RequestAdapterOptions, Surface,
};

use crate::error::{GraphicsError, words_of};

/// A graphics device. What happens to it, it notes: none of its calls panics when it fails.
pub struct Gpu {
    /// The device.
    pub device: Device,
    /// Its queue.
    pub queue: Queue,
    adapter: Adapter,
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// A device that draws without a window.
    ///
    /// `name` is a part of the adapter's [title](Self::title) in any case, as is the environment's
    /// `WGPU_ADAPTER_NAME` if there is none; without either the system's preferred adapter is taken, by `WGPU_POWER_PREF`
    /// (`low` or `high`; high if not set). `WGPU_BACKEND` (`vulkan`, `gl`, `metal`, `dx12`) narrows the
    /// choice.
    ///
    /// # Errors
    /// No adapter, none of that name, or one that cannot draw what is needed.
    pub fn new(name: Option<&str>) -> Result<Self, GraphicsError> {
        let instance = Instance::new(InstanceDescriptor::new_without_display_handle_from_env());
        Self::from_instance(&instance, None, name)
    }

    /// As [`Gpu::new`], for a window's surface.
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn for_surface(
        instance: &Instance,
        surface: &Surface<'_>,
        name: Option<&str>,
    ) -> Result<Self, GraphicsError> {
        Self::from_instance(instance, Some(surface), name)
    }

    /// A device that the host has already, of this adapter: textures of the one are the other's.
    ///
    /// It needs no feature, and [`Limits::downlevel_defaults`] or more. Of the limits that it was given, and not of the
    /// adapter's, pictures, frames and volumes may take as much as there is.
    ///
    /// Whom the device tells that it is lost, and of errors outside of any error scope, is replaced: [`Gpu::failure`]
    /// says so instead. Whatever goes wrong with the device, also by what the host does with it, ends the pictures.
    ///
    /// # Errors
    /// An adapter that cannot draw what is needed, or a device that may do less.
    pub fn from_device(
        adapter: Adapter,
        device: Device,
        queue: Queue,
    ) -> Result<Self, GraphicsError> {
        let title = fit(&adapter)?;
        let mut lacking = None;
        let allowed = device.limits();
        let needed = Limits::downlevel_defaults();
        needed.check_limits_with_fail_fn(&allowed, true, |name, needed, allowed| {
            lacking = Some(format!("a device whose {name} is {needed}, not {allowed}"));
        });
        match lacking {
            None => Ok(Self::noting(adapter, device, queue)),
            Some(lacking) => Err(GraphicsError::Unfit { adapter: title, lacking }),
        }
    }

    fn from_instance(
        instance: &Instance,
        surface: Option<&Surface<'_>>,
        name: Option<&str>,
    ) -> Result<Self, GraphicsError> {
        let from_environment = std::env::var("WGPU_ADAPTER_NAME").ok();
        let adapter = match name.map(str::to_owned).or(from_environment) {
            Some(name) => by_name(instance, surface, name)?,
            None => preferred(instance, surface)?,
        };
        let title = fit(&adapter)?;
        let wanted = DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
        let requested = pollster::block_on(adapter.request_device(&wanted));
        let (device, queue) = requested.map_err(|error| GraphicsError::NoDevice {
            adapter: title,
            reason: one_line(&error),
        })?;
        Ok(Self::noting(adapter, device, queue))
    }

    /// Has the device note what happens to it.
    fn noting(adapter: Adapter, device: Device, queue: Queue) -> Self {
        let failure = Arc::new(Mutex::new(None));
        note_failures(&device, &failure);
        Self { device, queue, adapter, failure }
    }

    /// The adapter.
    #[must_use]
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// The adapter's name and backend in one line.
    #[must_use]
    pub fn title(&self) -> String {
        title(&self.adapter.get_info())
    }

    /// Whether the adapter is software that draws on the processor's cores.
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.adapter.get_info().device_type == wgpu::DeviceType::Cpu
    }

    /// The first thing that went wrong with the device, if anything did. Nothing is drawn from then on.
    #[must_use]
    pub fn failure(&self) -> Option<GraphicsError> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.as_ref().map(|reason| GraphicsError::Lost { reason: reason.clone() })
    }

    /// A buffer with contents. Unlike wgpu's own helper it does not panic where the device has failed or has no memory
    /// left.
    pub(crate) fn buffer(&self, label: &str, contents: &[u8], usage: BufferUsages) -> Buffer {
        let buffer = self.device.create_buffer(&BufferDescriptor {
            label: Some(label),
            size: contents.len() as u64,
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, contents);
        buffer
    }

    /// Lets the device get on with what was submitted, or waits for it. Unlike wgpu's own it does not panic where the
    /// driver has lost the device.
    ///
    /// # Errors
    /// The device has failed, now or before.
    pub fn poll(&self, how: PollType) -> Result<(), GraphicsError> {
        if let Some(failure) = self.failure() {
            return Err(failure);
        }
        let polled = catch_unwind(AssertUnwindSafe(|| self.device.poll(how)));
        let reason = match polled {
            Ok(Ok(_)) => return Ok(()),
            Ok(Err(error)) => one_line(&error),
            Err(panic) => one_line(&words_of(&*panic).unwrap_or("it panicked")),
        };
        note(&self.failure, reason.clone());
        Err(self.failure().unwrap_or(GraphicsError::Lost { reason }))
    }

    /// The greatest width and height of a picture, in pixels.
    #[must_use]
    pub fn most_pixels(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }
}

/// Keeps the first failure: the later ones follow from it.
fn note(failure: &Mutex<Option<String>>, reason: String) {
    failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(reason);
}

/// Has the device note what goes wrong.
fn note_failures(device: &Device, failure: &Arc<Mutex<Option<String>>>) {
    let lost = Arc::clone(failure);
    device.set_device_lost_callback(move |_, reason| note(&lost, one_line(&reason)));
    let wrong = Arc::clone(failure);
    device.on_uncaptured_error(Arc::new(move |error| note(&wrong, one_line(&error))));
}

/// Sees that an adapter can draw what is needed, and gives its title.
fn fit(adapter: &Adapter) -> Result<String, GraphicsError> {
    let title = title(&adapter.get_info());
    if !adapter.get_downlevel_capabilities().flags.contains(DownlevelFlags::VERTEX_STORAGE) {
        let lacking = "storage buffers in vertex shaders".to_owned();
        return Err(GraphicsError::Unfit { adapter: title, lacking });
    }
    Ok(title)
}

fn preferred(instance: &Instance, surface: Option<&Surface<'_>>) -> Result<Adapter, GraphicsError> {
    let options = RequestAdapterOptions {
        power_preference: PowerPreference::from_env().unwrap_or(PowerPreference::HighPerformance),
        compatible_surface: surface,
        ..Default::default()
    };
    pollster::block_on(instance.request_adapter(&options)).map_err(|_| GraphicsError::NoAdapter)
}

fn by_name(
    instance: &Instance,
    surface: Option<&Surface<'_>>,
    name: String,
) -> Result<Adapter, GraphicsError> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(Backends::all()));
    adapters.retain(|adapter| surface.is_none_or(|surface| adapter.is_surface_supported(surface)));
    if adapters.is_empty() {
        return Err(GraphicsError::NoAdapter);
    }
    let titles: Vec<_> = adapters.iter().map(|adapter| title(&adapter.get_info())).collect();
    let wanted = name.to_lowercase();
    match titles.iter().position(|title| title.to_lowercase().contains(&wanted)) {
        Some(index) => Ok(adapters.swap_remove(index)),
        None => Err(GraphicsError::NoSuchAdapter { name, there: titles.join(", ") }),
    }
}

fn title(info: &AdapterInfo) -> String {
    format!("{} ({})", info.name, info.backend)
}

/// An error's text in one line.
pub(crate) fn one_line(error: &impl ToString) -> String {
    let text = error.to_string();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use wgpu::{BackendOptions, NoopBackendOptions};

    use super::*;

    /// Of devices that draw nothing, on any machine.
    fn instance() -> Instance {
        let noop = NoopBackendOptions { enable: true, ..Default::default() };
        Instance::new(InstanceDescriptor {
            backends: Backends::NOOP,
            backend_options: BackendOptions { noop, ..Default::default() },
            ..InstanceDescriptor::new_without_display_handle()
        })
    }

    fn gpu() -> Gpu {
        Gpu::from_instance(&instance(), None, None).expect("it is always there")
    }

    #[test]
    fn a_device_of_the_hosts_own_that_may_do_too_little_is_refused() {
        let take = |required_limits: Limits| {
            let adapter = preferred(&instance(), None).expect("it is always there");
            let wanted = DeviceDescriptor { required_limits, ..Default::default() };
            let requested = pollster::block_on(adapter.request_device(&wanted));
            let (device, queue) = requested.expect("it may do less than the adapter");
            Gpu::from_device(adapter, device, queue)
        };
        let least = Limits::downlevel_defaults();
        let gpu = take(least.clone()).expect("it may do what is needed");
        assert_eq!(gpu.device.limits(), least);
        let error = take(Limits { max_storage_buffers_per_shader_stage: 1, ..least }).err();
        let told = error.expect("it may do too little").to_string();
        let lacking = "lacks a device whose max_storage_buffers_per_shader_stage is 4, not 1";
        assert!(told.ends_with(lacking), "{told}");
    }

    #[test]
    fn a_panic_while_the_device_is_waited_for_is_its_failure() {
        let gpu = gpu();
        assert_eq!(gpu.poll(PollType::Poll), Ok(()));
        // Where wgpu panics itself if the driver has lost the device.
        gpu.queue.on_submitted_work_done(|| panic!("the driver\nhas lost the device"));
        let lost = GraphicsError::Lost { reason: "the driver has lost the device".to_owned() };
        assert_eq!(gpu.poll(PollType::wait_indefinitely()), Err(lost.clone()));
        assert_eq!(gpu.failure(), Some(lost.clone()));
        assert_eq!(gpu.poll(PollType::Poll), Err(lost), "the first failure is kept");
    }
}
