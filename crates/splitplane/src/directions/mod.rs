//! Where split directions come from.
