//! The page `docs/features.md` is the registry of features; pages of methods and models name only features of it.
//!
//! `WRITE_DOCS=1 cargo test -p scansion-tests --test house feature_page` writes the page.

use scansion_core::features::ContextParams;
use scansion_core::features::definition::{ALL, Definition, Feature, Group, Scope};
use scansion_core::recipes;
use std::path::{Path, PathBuf};

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

const HEAD: &str = "\
# Features

Written from the registry in `crates/core/src/features/definition.rs` by `WRITE_DOCS=1 cargo test -p scansion-tests --test
feature_page`; not to be edited. `scansion features --list` prints the same, as does `scansion.features.definitions()` in
Python.

| symbol | meaning |
|---|---|
| l1 >= l2 >= l3, e1, e2, e3 | eigenvalues and eigenvectors of the structure tensor of the neighbourhood |
| e1 >= e2 >= e3 of a segment | its eigenvalues divided by their sum |
| z | the vertical direction; the height of a point |
| p, p_n | the point; the n-th point of its neighbourhood |
| n, curvature | normal and surface variation of a point of the level on its own level |
| med | medoid: the one with the least sum of distances to the others |

`missing` is the value where the formula has none: points that coincide, a side without points, a height that is not known;
`-` if there always is a value. Rows of points that are not finite, or stray, are NaN.
";

/// Heading and introduction of the features of a scope.
fn heading(scope: Scope) -> &'static str {
    match scope {
        Scope::Level => {
            "## Features of a level\n\nFor each point on each level of the [pyramid](pyramid.md); the column has the \
             edge of the level's\nvoxels appended, as in `Planarity_r0p4` for 0.4 m. Used by the recipes `pyramid`, \
             `airborne`,\n`mobile`, `indoor`, `weak` and `contours`.\n"
        }
        Scope::Cell => {
            "## Profiles\n\nFor each point in its cell of a grid in plan; the column has the edge of the cell appended, as in \
             `GapBelow_r0p5` for\n0.5 m. Used by the recipe [`airborne`](airborne.md); others take them with the setting \
             `features.profile.cells`.\n"
        }
        Scope::Radius => {
            "## Features of spheres\n\nFor each point and radius; the column has the radius appended, as in \
             `SphereLinearity_r0p5` for 0.5 m. Used by the recipe\n[`spheres`](spheres.md).\n"
        }
        Scope::Class => {
            "## Context\n\nFor each point and class, with p the probability of the class in the first of two stages \
             ([auto-context](airborne.md));\nthe column has the code of the class and the edge of the voxels or cells \
             appended, as in `Voxel_6_r0p5`. Used by the\nrecipes `airborne`, `mobile`, `indoor` and \
             [`contours`](contours.md), which alone uses those that begin with `Band`.\n"
        }
        Scope::Point => {
            "## Features of points\n\nOnce for each point: its own columns (return numbers in the recipe `airborne`; others on \
             request), its\n[optimal neighbourhood](optimal-neighbourhood.md) and the [terrain](terrain.md) (recipe `weak`; the \
             height above the\nground, `Elevation`, also in `airborne`, `mobile`, `indoor`, `clusters` and `spheres`).\n"
        }
        Scope::Segment => {
            "## Features of segments\n\nFor each segment (recipe [`objects`](objects.md)); colours and heights if \
             there are any.\n"
        }
    }
}

/// A row of a table of Markdown.
fn row(d: &Definition) -> String {
    let formula = d.formula.replace('|', "\\|");
    format!("| {} | `{formula}` | {} | {} | {} |\n", d.name, d.range, d.unit, d.missing)
}

fn page() -> String {
    let mut page = HEAD.to_string();
    for scope in [Scope::Level, Scope::Cell, Scope::Radius, Scope::Class, Scope::Point, Scope::Segment] {
        page += &format!("\n{}", heading(scope));
        for group in Group::ALL.into_iter().filter(|group| group.scope() == scope) {
            page += &format!("\n### {}\n\nFrom {}.\n\n", group.name(), group.reach());
            page += "| feature | formula | range | unit | missing |\n|---|---|---|---|---|\n";
            page.extend(group.definitions().map(row));
        }
    }
    page
}

#[test]
fn the_page_is_the_registry() {
    let path = docs().join("features.md");
    if std::env::var_os("WRITE_DOCS").is_some() {
        std::fs::write(&path, page()).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap();
    assert!(
        found == page(),
        "docs/features.md is not the registry: see the first lines of tests/house/feature_page.rs"
    );
    assert!(ALL.iter().all(|d| found.contains(&format!("| {} | `", d.name))));
}

#[test]
fn pages_of_methods_name_the_features_of_the_registry() {
    for (page, groups) in [("optimal-neighbourhood.md", Group::Optimal), ("terrain.md", Group::Terrain)] {
        let text = std::fs::read_to_string(docs().join(page)).unwrap();
        assert!(groups.names().all(|name| text.contains(&format!("`{name}`"))), "{page}");
    }
    let text = std::fs::read_to_string(docs().join("pyramid.md")).unwrap();
    assert!(Group::Contour.names().all(|name| text.contains(&format!("`{name}`"))));
}

#[test]
fn the_features_of_the_built_in_model_are_in_the_registry() {
    let model = recipes::default_model().unwrap();
    let codes: Vec<u8> = model.trained.classes.classes().iter().map(|class| class.code).collect();
    let context = ContextParams::default().names(&codes);
    let scopes = [Scope::Level, Scope::Cell, Scope::Point];
    assert!(context.iter().all(|name| Feature::named(name, Scope::Class).is_some()), "{context:?}");
    let registered = |name: &String| scopes.iter().any(|&scope| Feature::named(name, scope).is_some());
    let first = model.trained.earlier.into_iter().flat_map(|stage| stage.feature_names).collect::<Vec<_>>();
    assert!(!first.is_empty() && first.iter().all(registered), "{first:?}");
    let known = |name: &String| registered(name) || context.contains(name);
    assert!(
        !model.trained.feature_names.is_empty() && model.trained.feature_names.iter().all(known),
        "{:?}",
        model.trained.feature_names
    );
}
