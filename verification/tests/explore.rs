//! Runs every model. Plain `cargo test` does: the library under test is compiled under loom
//! whatever the environment says.

mod models;

macro_rules! explored {
    ($($primitive:ident)*) => {$(
        #[test]
        fn $primitive() {
            models::$primitive::ALL.iter().for_each(|(_, model)| model());
        }
    )*};
}

explored!(ring countdown arrivals inbox latest bell token pipeline);
