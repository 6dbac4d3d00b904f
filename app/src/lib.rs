//! Osteotome, the program: loading, the case, the command line, the window.
//!
//! [`load`] reads files into the world's frame; [`case`] is what is planned, changed only by
//! [`case::Edit`]; [`scene`] turns a case and its data into what `render` draws, [`sections`] into what flat
//! pictures show; [`headless`] runs jobs
//! without a display and [`host`] the window, where [`tools`] live; [`save`] writes data files and pictures. [`steps`]
//! are a volume over time. [`jobs`] runs what takes long in the background. [`sample`] makes the built-in hip, [`presets`] and [`colormaps`] name
//! transfer functions, and [`added`] says what loaded data become in a case.

pub mod added;
pub mod case;
pub mod cli;
pub mod colormaps;
pub mod headless;
pub mod host;
pub mod jobs;
pub mod load;
pub mod presets;
pub mod sample;
pub mod save;
pub mod scene;
pub mod sections;
pub mod steps;
pub mod tools;
pub mod ui;
