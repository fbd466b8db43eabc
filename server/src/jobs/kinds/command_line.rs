//! Parts of the command line of a worker.

use std::path::Path;

/// Output folder, relative to the job folder.
pub(crate) const OUT_DIR: &str = "out";

/// Paths of the inputs of a job: absolute, or relative to the job folder.
#[derive(Clone, Debug, Default)]
pub(crate) struct InputPaths<'a> {
    /// Folder of the dataset.
    pub(crate) dataset: Option<&'a Path>,
    /// Folder of the encoder or the model.
    pub(crate) model: Option<&'a Path>,
    /// File of the mesh.
    pub(crate) mesh: Option<&'a Path>,
}

/// Arguments as owned strings.
pub(super) fn args<const N: usize>(args: [&str; N]) -> Vec<String> {
    args.map(str::to_owned).into()
}

/// `--name value`; empty without a value.
pub(super) fn option_args<T: ToString>(name: &str, value: Option<T>) -> Vec<String> {
    value.map_or(Vec::new(), |value| vec![format!("--{name}"), value.to_string()])
}

/// A path as an argument; empty without a path.
pub(super) fn path_arg(path: Option<&Path>) -> String {
    path.unwrap_or(Path::new("")).display().to_string()
}
