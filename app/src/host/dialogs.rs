//! The system's file dialogs, on a thread of their own so that the window goes on drawing.

use std::io;
use std::path::PathBuf;

use crate::jobs::{Job, Poll};

use super::session::Wake;

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// Files to open.
    OpenFiles,
    /// A folder to open.
    OpenFolder,
    /// Where to save the case.
    SaveCase,
}

/// A dialog that is open.
#[derive(Debug)]
pub struct Dialog {
    question: Question,
    job: Job<Vec<PathBuf>>,
}

/// Endings of what can be opened.
const DATA: &[&str] =
    &["json", "dcm", "zip", "nii", "gz", "nrrd", "nhdr", "mha", "mhd", "stl", "obj", "ply", "glb", "gltf"];

impl Dialog {
    /// Opens a dialog. `wake` is called when it is answered.
    ///
    /// # Errors
    /// Where the system gives no thread.
    pub fn open(question: Question, wake: Wake) -> io::Result<Self> {
        let work = move |_: &crate::jobs::Reporter| {
            let dialog = rfd::FileDialog::new();
            match question {
                Question::OpenFiles => dialog
                    .set_title("Open cases, volumes or surfaces")
                    .add_filter("Cases, volumes and surfaces", DATA)
                    .add_filter("All files", &["*"])
                    .pick_files()
                    .unwrap_or_default(),
                Question::OpenFolder => {
                    dialog.set_title("Open a DICOM series").pick_folder().into_iter().collect()
                }
                Question::SaveCase => dialog
                    .set_title("Save the case")
                    .add_filter("Osteotome case", &["json"])
                    .set_file_name("case.json")
                    .save_file()
                    .into_iter()
                    .collect(),
            }
        };
        Ok(Self { question, job: Job::start("dialog", work, move || wake())? })
    }

    /// The question and its answer, once: no path where it was dismissed.
    pub fn answer(&self) -> Option<(Question, Vec<PathBuf>)> {
        match self.job.poll() {
            Poll::Running => None,
            Poll::Done(paths) => Some((self.question, paths)),
            Poll::Lost => Some((self.question, Vec::new())),
        }
    }
}
