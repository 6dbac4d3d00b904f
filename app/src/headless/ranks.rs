//! The program as several processes that `mpirun` has started together: they draw one picture.
//!
//! The first does what it would do alone, and has the others help it to draw unstructured grids; the others read no data and
//! write no files. Needs the program to be built with the feature `mpi`; one that is not says so, instead of doing
//! everything as often as there are processes.

use ::render::cells::{Group, Link};
use ::render::cpu::CpuError;

use super::Failure;

/// The processes that draw together, as the first of them has them.
pub type Ranks = Group<Box<dyn Link>>;

/// What this process is.
#[derive(Debug)]
pub enum Place {
    /// The only one.
    Alone,
    /// The first of several.
    First(Ranks),
    /// Another, and there is nothing more to do.
    Done,
}

/// How many processes were started together: what Open MPI's launcher says, or that of MPICH and its kin.
pub fn count() -> usize {
    of_launcher(["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"]).unwrap_or(1)
}

/// Whether this is the first of them, as far as the launcher says.
pub fn is_first() -> bool {
    of_launcher(["OMPI_COMM_WORLD_RANK", "PMI_RANK"]).is_none_or(|rank| rank == 0)
}

fn of_launcher(names: [&str; 2]) -> Option<usize> {
    names.into_iter().find_map(|name| std::env::var(name).ok()?.parse().ok())
}

/// Takes this process's place among those that were started together. All but the first help until the first has done all.
///
/// # Errors
/// [`Failure::Usage`] where the program cannot be several processes, [`Failure::Cpu`] where one of them fails.
pub fn join() -> Result<Place, Failure> {
    let count = count();
    if count < 2 {
        return Ok(Place::Alone);
    }
    let link = match link(count) {
        // One of them says so for all.
        Err(_) if !is_first() => return Ok(Place::Done),
        link => link?,
    };
    let group = Group::join(link).map_err(|error| Failure::Cpu(CpuError::from(error)))?;
    Ok(group.map_or(Place::Done, Place::First))
}

#[cfg(feature = "mpi")]
fn link(count: usize) -> Result<Box<dyn Link>, Failure> {
    let link = ::render::cells::mpi::MpiLink::begin().map_err(|error| Failure::Other(error.to_string()))?;
    if link.size() != count {
        return Err(Failure::Usage(format!(
            "{count} processes were started by the mpirun of another MPI than this program was built with; \
             use the mpirun that belongs to it"
        )));
    }
    Ok(Box::new(link))
}

#[cfg(not(feature = "mpi"))]
fn link(count: usize) -> Result<Box<dyn Link>, Failure> {
    Err(Failure::Usage(format!(
        "this program was built without the feature mpi, so {count} processes would each do the same; \
         start it without mpirun, or build it with --features mpi"
    )))
}
