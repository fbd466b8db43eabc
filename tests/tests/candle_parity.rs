//! Inference network (`policy`) against training network (`imitation`, candle) on states of a dataset.

use configs::DatasetConfig;
use grasps::RobotContext;
use imitation::data::split;
use imitation::models::encoder::TrainedEncoder;
use imitation::nn::Params;
use imitation::nn::networks::{self, Network};
use objects::catalog::built_in_objects;
use policy::model::ModelConfig;
use policy::weights::Tensors;
use progress::NoProgress;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use robot::{DOF, JointState};

/// Minimum number of compared states.
const MIN_STATES: usize = 1000;

#[test]
fn inference_and_training_networks_agree_on_dataset_states() {
    let folder = tempfile::tempdir().unwrap();
    let robot = RobotContext::standard().unwrap();
    let config = DatasetConfig::preset("smoke", 3).unwrap();
    let objects = built_in_objects(config.all_objects()).unwrap();
    let dataset = datagen::create(&folder.path().join("data"), &config, &objects, false).unwrap();
    datagen::generate(&dataset, &robot, &objects, &NoProgress).unwrap();

    let weights = include_bytes!("../../models/default/weights.safetensors");
    let config = ModelConfig::parse(include_bytes!("../../models/default/config.json")).unwrap();
    let encoder = TrainedEncoder::from_model(weights).unwrap();
    let mut params = Params::default();
    networks::init(&mut params, &config.policy, &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
    params.restore(weights).unwrap();
    let twin = Network::new(&config.policy, &robot.tree).unwrap();
    let weights = Tensors::parse(weights).unwrap();
    let runs = policy::Network::load(&weights, &config.policy, &robot.tree).unwrap();

    let observation = config.policy.observation;
    let (train, held_out) =
        split::train_val_split(std::slice::from_ref(&dataset), &encoder, observation, 3).unwrap();
    let mut compared = 0;
    let mut max_error = 0.0f64;
    for lesson in train.iter().chain(&held_out) {
        let object = &lesson.encodings[0];
        let rows = lesson.demonstrations.rows();
        let states: Vec<JointState> = (0..rows)
            .step_by(2)
            .map(|row| object.state_to_canonical(&lesson.demonstrations.state(row)))
            .collect();
        let z = vec![object.latent.as_slice(); states.len()];
        let got = twin.forward(&params, &states, &z).unwrap().accelerations;
        for (state, got) in states.iter().zip(got.to_vec2::<f32>().unwrap()) {
            let input = policy::NetworkInput::new(*state, &object.latent);
            let wanted = runs.accelerations(&[input])[0].unwrap();
            let error = (0..DOF).map(|i| (f64::from(got[i]) - wanted[i]).abs()).fold(0.0, f64::max);
            max_error = max_error.max(error / wanted.norm());
            compared += 1;
        }
    }
    assert!(compared >= MIN_STATES, "{compared} states");
    assert!(max_error < 1e-4, "relative error of {max_error} (norm of the acceleration)");
}
