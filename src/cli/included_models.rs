//! Models on the disk that an SDF model includes by a URI such as `model://gps`.

use inputs::{InputFiles, tidy};
use std::path::{Path, PathBuf};

/// Environment variables with folders of models, of Gazebo Classic and of Gazebo Sim.
const VARIABLES: [&str; 2] = ["GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH"];
/// Description of a model folder, which names its SDF file.
const CONFIG: &str = "model.config";

/// Text of the model that `uri` names in a model in the file `from`, or the reason why it cannot be read; `None` if it is not
/// found.
///
/// It is looked for beside the folder of `from`, in that folder, and in the folders of the simulator's variables.
pub fn read(from: &Path, uri: &str) -> Option<Result<String, String>> {
    let name = uri.strip_prefix("model://").or_else(|| uri.strip_prefix("file://")).unwrap_or(uri);
    let file_in = |folder: PathBuf| {
        let path = folder.join(name);
        if path.is_dir() { file_of(&path) } else { Some(path).filter(|path| path.is_file()) }
    };
    let file = folders(from).into_iter().find_map(file_in)?;
    let text = InputFiles::default().text(&file);
    Some(text.map_err(|error| format!("cannot read {}: {error}", file.display())))
}

fn folders(from: &Path) -> Vec<PathBuf> {
    let beside = from.parent().unwrap_or(Path::new("")).to_owned();
    let folder = if beside.as_os_str().is_empty() { PathBuf::from(".") } else { beside };
    let beside = tidy(&folder.join(".."));
    let stated = VARIABLES.iter().filter_map(std::env::var_os);
    let stated = stated.flat_map(|folders| std::env::split_paths(&folders).collect::<Vec<_>>());
    [beside, folder].into_iter().chain(stated.filter(|folder| !folder.as_os_str().is_empty())).collect()
}

/// The SDF file of a model's folder: the last that its description names, which is of the newest format, or `model.sdf`.
fn file_of(folder: &Path) -> Option<PathBuf> {
    let config = InputFiles::default().text(&folder.join(CONFIG)).unwrap_or_default();
    let named = config.rsplit_once("</sdf>").and_then(|(before, _)| before.rsplit_once('>'));
    let named = named.map(|(_, name)| folder.join(name.trim()));
    named.into_iter().chain([folder.join("model.sdf")]).find(|file| file.is_file())
}
