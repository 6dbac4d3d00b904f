//! What can go wrong on a graphics device, as values.

use thiserror::Error;

/// Why the GPU drew nothing.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum GpuError {
    /// Only the processor draws this.
    #[error("{what} is not drawn by the GPU: draw it by the processor (--backend cpu)")]
    CpuOnly {
        /// What it is.
        what: &'static str,
    },
    /// No adapter answers.
    #[error(
        "no usable GPU was found ({reason}); install a Vulkan driver (on Debian: mesa-vulkan-drivers, \
         which also draws on the CPU) or use the reference backend"
    )]
    NoAdapter {
        /// What the system said.
        reason: String,
    },
    /// The adapter is there but gives no device.
    #[error("the GPU {adapter} refused to open ({reason}); update its driver or use the reference backend")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
    /// Memory ran out.
    #[error("the GPU has too little memory for {what}; choose a compressed texture or a smaller picture")]
    OutOfMemory {
        /// What was being made.
        what: &'static str,
    },
    /// A picture or a buffer is larger than the device allows.
    #[error("{what} needs {needed}, but this GPU allows {allowed}; choose a smaller one")]
    TooLarge {
        /// What is too large.
        what: &'static str,
        /// What it needs.
        needed: u64,
        /// What there is.
        allowed: u64,
    },
    /// The device stopped answering.
    #[error("the GPU stopped answering ({reason}); open the case again")]
    Lost {
        /// What the driver said.
        reason: String,
    },
    /// A call broke the device's rules: a defect of this program.
    #[error("the GPU refused a call ({reason}); please report this")]
    Refused {
        /// What the validation said.
        reason: String,
    },
    /// The scene's camera shows nothing.
    #[error(transparent)]
    Camera(#[from] crate::scene::CameraError),
    /// A picture without pixels.
    #[error("a picture of {width} x {height} pixels has none")]
    EmptyPicture {
        /// As asked.
        width: u32,
        /// As asked.
        height: u32,
    },
    /// A fragment keeps the outside of more cylinders than the shader counts.
    #[error("a fragment keeps the outside of {count} cylinders; at most {limit} can be drawn")]
    Cylinders {
        /// As asked.
        count: usize,
        /// What there is.
        limit: usize,
    },
    /// Block encoding failed.
    #[error("a volume could not be encoded: {reason}")]
    Encode {
        /// What the encoder said.
        reason: String,
    },
}
