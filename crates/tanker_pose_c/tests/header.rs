//! The header is what cbindgen makes of the sources.

use std::path::Path;

#[test]
fn the_header_is_the_one_of_the_sources() {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config =
        cbindgen::Config::from_file(package.join("cbindgen.toml")).expect("a configuration");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in ["lib.rs", "estimator.rs", "types.rs"] {
        builder = builder.with_src(package.join("src").join(source));
    }
    let mut made = Vec::new();
    builder.generate().expect("a header").write(&mut made);
    let made = String::from_utf8(made).expect("text");
    let path = package.join("include/tanker_pose.h");
    if std::env::var_os("WRITE_HEADER").is_some() {
        std::fs::write(&path, &made).expect("written");
    }
    let kept = std::fs::read_to_string(&path).expect("the header");
    assert!(
        kept == made,
        "include/tanker_pose.h is not what the sources say: run this test with WRITE_HEADER=1"
    );
}
