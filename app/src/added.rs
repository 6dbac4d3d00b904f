//! What loaded data become in a case before anybody has chosen: the same in the window and without it.

use std::sync::Arc;

use crate::case::assets::{Asset, Data};
use crate::case::{Case, Edit, Implant, UnstructuredGrid, Volume};
use crate::presets;

/// The change that puts loaded data into a case, with the defaults of their kind.
pub fn edit(case: &Case, asset: &Asset) -> Edit {
    let source = asset.key.source.clone();
    let wish = source.short_name();
    match &asset.data {
        Data::Mesh(_) => {
            let mut implant = Implant::new(case.free_implant_id(&wish), source);
            implant.item = asset.key.item;
            Edit::AddImplant(Box::new(implant))
        }
        Data::Cells(_) => {
            let mut grid = UnstructuredGrid::new(case.free_grid_id(&wish), source);
            grid.item = asset.key.item;
            Edit::AddGrid(Box::new(grid))
        }
        Data::Grid(_) | Data::Steps(_) => {
            let range = asset.data.range().unwrap_or([0.0, 1.0]);
            let transfer = presets::default_for(asset.modality.as_deref(), range);
            let mut volume = Volume::new(case.free_volume_id(&wish), source, Arc::new(transfer));
            volume.item = asset.key.item;
            Edit::AddVolume(Box::new(volume))
        }
    }
}
