//! Sets of grasps: their files, clusters, selection and symmetry.

pub mod catalog;
pub mod clusters;
pub mod grasp;
pub mod grasp_set;
pub mod import;
pub mod k_medoids;
pub mod selection;
pub mod symmetry;
