//! `message!` writes a message struct and keeps its layout as text, for [`crate::SCHEMA`].
//! With the feature `transport` it needs `iceoryx2::prelude::ZeroCopySend` in scope.

macro_rules! message {
    (
        $(#[$meta:meta])*
        pub struct $name:ident as $type_name:literal {
            $( $(#[$field_meta:meta])* pub $field:ident : $type:ty ),* $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(
            Clone, Copy, Debug, PartialEq,
            // Also: no padding, whose bytes would be anybody's guess.
            zerocopy::IntoBytes, zerocopy::FromBytes, zerocopy::Immutable, zerocopy::KnownLayout,
        )]
        #[cfg_attr(feature = "transport", derive(ZeroCopySend))]
        #[repr(C)]
        #[cfg_attr(feature = "transport", type_name($type_name))]
        pub struct $name {
            $( $(#[$field_meta])* pub $field: $type, )*
        }

        impl $name {
            /// Type name, then name and type of every field in order.
            pub const LAYOUT: &'static str = concat!(
                $type_name, "{", $( stringify!($field), ":", stringify!($type), ";", )* "}"
            );
        }
    };
}
