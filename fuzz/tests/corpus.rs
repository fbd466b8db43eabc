//! The corpus once more.

use std::path::Path;

#[test]
fn nothing_in_the_corpus_breaks_anything() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for (name, target) in fuzz::TARGETS {
        let files = std::fs::read_dir(corpus.join(name)).expect("a corpus");
        let mut count = 0;
        for file in files {
            let path = file.expect("a file").path();
            println!("{}", path.display());
            target(&std::fs::read(&path).expect("bytes"));
            count += 1;
        }
        assert!(count >= 3, "{name} has {count} files");
    }
}
