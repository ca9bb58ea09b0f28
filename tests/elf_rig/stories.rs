//! Stories that are told on the native board and on the firmware.

/// Makes a test for each board of every story, which is a function of the kind of board.
#[allow(unused_macros, reason = "each test file uses its own part")]
macro_rules! stories {
    ($($story:ident),* $(,)?) => {
        mod native {
            $(#[test] fn $story() { super::$story::<super::NativeBoard>(); })*
        }
        mod firmware {
            $(#[test] fn $story() { super::$story::<super::ElfBoard>(); })*
        }
    };
}

pub(crate) use stories;
