//! Hash of the scene: identifies the experiment in recordings, links, datasets and model cards.

use crate::config::SceneConfig;
use robot::KinematicTree;
use std::sync::LazyLock;

/// BLAKE3 hash (hex) of the standard scene and robot; see [`hash_values`].
pub fn scene_hash() -> String {
    static HASH: LazyLock<String> = LazyLock::new(|| {
        // Both files are embedded at compile time, and tests parse them.
        let config = SceneConfig::standard().expect("the embedded scene file is valid");
        let tree = KinematicTree::iiwa7_allegro().expect("the embedded robot description is valid");
        hash_values(&config, &tree)
    });
    HASH.clone()
}

/// BLAKE3 hash (hex) of all values of a scene and a robot in declaration order, in postcard's encoding.
///
/// Names of fields, comments and formatting of the files do not contribute.
pub fn hash_values(config: &SceneConfig, tree: &KinematicTree) -> String {
    let bytes = postcard::to_allocvec(&(config, tree)).expect("all fields are plain values");
    blake3::hash(&bytes).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scene_hash_changes_with_every_kind_of_value() {
        let config = SceneConfig::standard().unwrap();
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let hash = hash_values(&config, &tree);
        assert_eq!(hash, scene_hash());
        let mut other = config.clone();
        other.motors.joint_damping[1] += 1e-6;
        assert_ne!(hash, hash_values(&other, &tree));
        let mut other = config.clone();
        other.protocol.hold_seconds = 1.0;
        assert_ne!(hash, hash_values(&other, &tree));
        let mut heavier = tree.clone();
        heavier.bodies[3].mass += 1e-9;
        assert_ne!(hash, hash_values(&config, &heavier));
        let mut shifted = tree;
        shifted.palm.body_from_frame.translation.x += 1e-9;
        assert_ne!(hash, hash_values(&config, &shifted));
    }
}
