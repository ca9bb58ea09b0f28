//! The page on which people see and drive the rig.
