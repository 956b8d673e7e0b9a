//! The words of the command line for values that other crates define. Those crates know no flags.

use clap::ValueEnum;

use crate::integrate;
use crate::system;

/// Mirrors an enum of another crate: same variants, documented for `--help`.
macro_rules! mirror {
    ($(#[$meta:meta])* $name:ident = $other:path { $($(#[doc =
        $doc:literal])* $variant:ident,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        pub enum $name {
            $($(#[doc = $doc])* $variant,)*
        }

        impl From<$name> for $other {
            fn from(word: $name) -> Self {
                use $other as Other;
                match word {
                    $($name::$variant => Other::$variant,)*
                }
            }
        }

        impl $name {
            /// The word for a value. It is here so that a variant added elsewhere and forgotten
            /// here does not compile.
            pub fn of(value: $other) -> Self {
                use $other as Other;
                match value {
                    $(Other::$variant => $name::$variant,)*
                }
            }
        }
    };
}

mirror! {
    /// An integration method.
    Method = integrate::Method {
        /// Adams and BDF with automatic switching: NDSolve's default of the paper's day.
        Lsoda,
        /// Dormand-Prince 5(4).
        Dopri5,
        /// Radau IIA of order 5.
        Radau5,
        /// Taylor series that resolve the layer, in f64.
        Taylor,
        /// The same in double-double arithmetic, about 32 digits.
        TaylorExtended,
        /// Taylor series outside the layer, its own variable inside: smoothed systems that are
        /// polynomials outside.
        Layered,
    }
}

mirror! {
    /// Orbit before the start.
    History = integrate::delay::History {
        /// At the start, all the time.
        Constant,
        /// On the orbit of the system without delay that leads to the start.
        Flow,
    }
}

mirror! {
    /// Initial field of a relay inside its band.
    Inside = integrate::delay::Inside {
        /// f+ where h > 0, f- otherwise.
        Sign,
        /// f+.
        Plus,
        /// f-.
        Minus,
    }
}

mirror! {
    /// The law of a kick of size s.
    KickLaw = integrate::KickLaw {
        /// Length exactly s, direction uniform on the sphere.
        Sphere,
        /// Each component uniform on [-s, s).
        Cube,
        /// Each component normal with standard deviation s.
        Normal,
    }
}

mirror! {
    /// Reading of the two divisions by eps' in eq. (10).
    Relaxation = system::Relaxation {
        /// As printed: psi divides by eps' once more.
        Literal,
        /// One division.
        Single,
    }
}

/// A transition function of the smoothed switch, without the numbers that other flags give.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Transition {
    /// phi = (1 + tanh(h/eps))/2, the article's.
    Tanh,
    /// phi = 1/2 + arctan(h/eps)/pi.
    Arctan,
    /// phi = (1 + u/sqrt(1 + u^2))/2, u = h/eps.
    Algebraic,
    /// phi = (1 + erf(h/eps))/2.
    Erf,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_the_names_that_files_use() {
        for method in integrate::Method::ALL {
            let word = Method::of(method);
            assert_eq!(integrate::Method::from(word), method);
            assert_eq!(word.to_possible_value().unwrap().get_name(), method.name());
        }
    }
}
