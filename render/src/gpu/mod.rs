//! The graphics device: opened headless or taken from a window, with what it can do.

mod error;
mod readback;

use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

pub use error::GpuError;
pub(crate) use readback::{read_buffer, read_texture};

/// Features used where an adapter has them; each has a fall-back where it has not.
const WANTED: wgpu::Features = wgpu::Features::TEXTURE_COMPRESSION_BC
    .union(wgpu::Features::TEXTURE_COMPRESSION_BC_SLICED_3D)
    .union(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM)
    .union(wgpu::Features::FLOAT32_FILTERABLE)
    .union(wgpu::Features::FLOAT32_BLENDABLE);

/// The features of `adapter` that this crate uses; ask for them when opening a device for it.
pub fn wanted_features(adapter: &wgpu::Adapter) -> wgpu::Features {
    adapter.features() & WANTED
}

/// The limits to ask of `adapter`: its own, since volumes need its largest textures and buffers.
pub fn wanted_limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
    adapter.limits()
}

/// What a device can do, of what matters here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Caps {
    /// BC blocks in 3D textures.
    pub bc_3d: bool,
    /// 16-bit normalised textures.
    pub norm16: bool,
    /// Linear filtering of 32-bit floats.
    pub float_filter: bool,
    /// Blending into 32-bit floats.
    pub float_blend: bool,
    /// Longest side of a 3D texture, texels.
    pub texture_3d: u32,
    /// Longest side of a 2D texture, texels.
    pub texture_2d: u32,
    /// Largest storage buffer that a shader may see, bytes.
    pub storage_bytes: u64,
    /// Whether the CPU does the work.
    pub software: bool,
    /// Bytes that the texture of one volume may take where its format is left to the renderer.
    pub texture_budget: u64,
}

/// A graphics device and its queue.
#[derive(Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    adapter: String,
    caps: Caps,
    /// Calls until the device is given up, for tests; 0: never.
    lost_after: AtomicU32,
    /// The last fault that no call returned: set by the device's callbacks.
    fault: Arc<Mutex<Option<GpuError>>>,
    lost: Arc<AtomicBool>,
}

impl Gpu {
    /// Opens the best adapter there is, without a window. A software adapter is taken where no other is.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] and [`GpuError::NoDevice`].
    pub fn headless() -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .map_err(|e| GpuError::NoAdapter { reason: e.to_string() })?;
        let request = wgpu::DeviceDescriptor {
            label: Some("headless.device"),
            required_features: wanted_features(&adapter),
            required_limits: wanted_limits(&adapter),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&request))
            .map_err(|e| GpuError::NoDevice { adapter: adapter.get_info().name, reason: e.to_string() })?;
        Ok(Self::from_wgpu(&adapter, device, queue))
    }

    /// Takes over a window's device. What the device was opened without is not used.
    pub fn from_wgpu(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let (features, limits, info) = (device.features(), device.limits(), adapter.get_info());
        let has = |feature| features.contains(feature);
        let caps = Caps {
            bc_3d: has(wgpu::Features::TEXTURE_COMPRESSION_BC_SLICED_3D),
            norm16: has(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM),
            float_filter: has(wgpu::Features::FLOAT32_FILTERABLE),
            float_blend: has(wgpu::Features::FLOAT32_BLENDABLE),
            texture_3d: limits.max_texture_dimension_3d,
            texture_2d: limits.max_texture_dimension_2d,
            storage_bytes: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size),
            software: info.device_type == wgpu::DeviceType::Cpu,
            texture_budget: u64::MAX,
        };
        let fault = Arc::new(Mutex::new(None));
        let seen = Arc::clone(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let error = match error {
                wgpu::Error::OutOfMemory { .. } => GpuError::OutOfMemory { what: "a picture" },
                other => GpuError::Refused { reason: other.to_string() },
            };
            // The first fault is the cause; those after it are its echo.
            seen.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }));
        let lost = Arc::new(AtomicBool::new(false));
        let (seen, is_lost) = (Arc::clone(&fault), Arc::clone(&lost));
        device.set_device_lost_callback(move |_, reason| {
            is_lost.store(true, Ordering::Relaxed);
            let lost = GpuError::Lost { reason };
            // Whatever else was reported is an echo of this.
            *seen.lock().unwrap_or_else(PoisonError::into_inner) = Some(lost);
        });
        let adapter = format!("{} ({:?})", info.name, info.backend);
        Self { device, queue, adapter, caps, lost_after: AtomicU32::new(0), fault, lost }
    }

    /// Name and interface of the adapter: `"llvmpipe (LLVM 15.0.6, 256 bits) (Vulkan)"`.
    pub fn adapter(&self) -> &str {
        &self.adapter
    }

    /// What the device can do.
    pub fn caps(&self) -> Caps {
        self.caps
    }

    /// Gives the device up, as a driver does that is reset, before the `call`th call from now, counted from 1: what a
    /// program does then can be tried at every place. Returns the calls that were left of an earlier order, 0 where
    /// it was carried out.
    pub fn lose_after(&self, call: u32) -> u32 {
        self.lost_after.swap(call, Ordering::Relaxed)
    }

    /// Whether the device is lost, which it is asked first. It stays so.
    pub fn is_lost(&self) -> bool {
        self.poll(wgpu::PollType::Poll).is_err() || self.lost.load(Ordering::Relaxed)
    }

    /// A call is about to be made that a lost device answers with a fault.
    pub(crate) fn count_call(&self) {
        let left = self.lost_after.load(Ordering::Relaxed);
        if left > 0 {
            self.lost_after.store(left - 1, Ordering::Relaxed);
            if left == 1 {
                self.device.destroy();
            }
        }
    }

    /// Submits recorded work.
    pub(crate) fn submit(&self, encoder: Option<wgpu::CommandEncoder>) {
        self.count_call();
        self.queue.submit(encoder.map(wgpu::CommandEncoder::finish));
    }

    /// Takes the fault that the device reported since the last call, if any.
    ///
    /// # Errors
    /// That fault.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        let take = || self.fault.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(fault) = take() else { return Ok(()) };
        // What a lost device is asked for is refused before the loss is told: ask whether there is one to tell.
        self.poll(wgpu::PollType::Poll)?;
        Err(take().filter(|later| matches!(later, GpuError::Lost { .. })).unwrap_or(fault))
    }

    /// Lets the device tell what is done; [`GpuError::Lost`] where it does not answer.
    fn poll(&self, how: wgpu::PollType) -> Result<(), GpuError> {
        #[expect(clippy::disallowed_methods, reason = "wgpu 30 panics where a wait finds the device lost")]
        let polled = std::panic::catch_unwind(AssertUnwindSafe(|| self.device.poll(how)));
        match polled {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(error)) => Err(GpuError::Lost { reason: error.to_string() }),
            Err(_) => {
                self.lost.store(true, Ordering::Relaxed);
                Err(GpuError::Lost { reason: "it was lost while it was waited for".to_owned() })
            }
        }
    }

    /// Waits until all that was submitted is done.
    ///
    /// # Errors
    /// [`GpuError::Lost`], or what the device reported meanwhile.
    pub(crate) fn wait(&self) -> Result<(), GpuError> {
        let done = self.poll(wgpu::PollType::Wait { submission_index: None, timeout: None });
        self.check()?;
        done
    }
}
