//! What can be computed of a ball or cylinder: the names are those of the Python package jakteristics 0.6.2.

use crate::error::{Error, Result};

macro_rules! quantities {
    ($($variant:ident $name:literal $doc:literal;)*) => {
        /// A number that describes the points around a point. λ1 ≥ λ2 ≥ λ3 and e1, e2, e3 are the eigenvalues and
        /// eigenvectors of their covariance.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Quantity {
            $(#[doc = $doc] $variant,)*
        }

        impl Quantity {
            /// All, in the order of their columns.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The name, as jakteristics writes it.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// The formula.
            pub const fn formula(self) -> &'static str {
                match self { $(Self::$variant => $doc,)* }
            }
        }
    };
}

quantities! {
    Sum "eigenvalue_sum" "λ1 + λ2 + λ3, m²";
    Omnivariance "omnivariance" "(λ1 λ2 λ3)^(1/3), m²";
    Eigenentropy "eigenentropy" "−Σ λ ln λ, λ in m²";
    Anisotropy "anisotropy" "(λ1 − λ3) / λ1";
    Planarity "planarity" "(λ2 − λ3) / λ1";
    Linearity "linearity" "(λ1 − λ2) / λ1";
    FirstShare "PCA1" "λ1 / Σλ";
    SecondShare "PCA2" "λ2 / Σλ";
    SurfaceVariation "surface_variation" "λ3 / Σλ";
    Sphericity "sphericity" "λ3 / λ1";
    Verticality "verticality" "1 − |z . e3|";
    NormalX "nx" "x of e3";
    NormalY "ny" "y of e3";
    NormalZ "nz" "z of e3";
    Count "number_of_neighbors" "number of points, the point itself included";
    Eigenvalue1 "eigenvalue1" "λ1, m²";
    Eigenvalue2 "eigenvalue2" "λ2, m²";
    Eigenvalue3 "eigenvalue3" "λ3, m²";
    Eigenvector1X "eigenvector1x" "x of e1";
    Eigenvector1Y "eigenvector1y" "y of e1";
    Eigenvector1Z "eigenvector1z" "z of e1";
    Eigenvector2X "eigenvector2x" "x of e2";
    Eigenvector2Y "eigenvector2y" "y of e2";
    Eigenvector2Z "eigenvector2z" "z of e2";
    Eigenvector3X "eigenvector3x" "x of e3";
    Eigenvector3Y "eigenvector3y" "y of e3";
    Eigenvector3Z "eigenvector3z" "z of e3";
}

impl Quantity {
    /// The quantity of this name.
    ///
    /// # Errors
    /// If there is none; the message lists all.
    pub fn named(name: &str) -> Result<Self> {
        Self::ALL.iter().copied().find(|q| q.name() == name).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|q| q.name()).collect();
            Error::parameter("features", name, format!("one of {}", names.join(", ")))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_find_their_quantities_and_a_wrong_one_lists_all() {
        assert!(Quantity::ALL.iter().all(|&q| Quantity::named(q.name()).unwrap() == q));
        let message = Quantity::named("roughness").unwrap_err().to_string();
        assert!(message.contains("roughness") && message.contains("surface_variation"), "{message}");
    }
}
