//! Examples at the end of each command's help.

pub(super) const DEMO: &str = "Example:
  scansion demo -o tour                                      scan, classes, pictures and scores in tour/";

pub(super) const INFO: &str = "Examples:
  scansion info my.laz                                       what the header says
  scansion info *.laz --stats --json                         classes, density, warnings of many files, for programs";

pub(super) const CONVERT: &str = "Examples:
  scansion convert scan.e57 scan.laz                         another format
  scansion convert all.copc.laz part.laz --bounds 652000,6861000,652200,6861200
  scansion convert all.copc.laz thin.laz --resolution 0.5    about one point every half unit
  scansion convert --salvage broken.laz saved.laz            the intact part of a damaged file";

pub(super) const COMPLETIONS: &str = "Examples:
  scansion completions bash > ~/.local/share/bash-completion/completions/scansion
  scansion completions zsh > ~/.zfunc/_scansion
  scansion completions fish > ~/.config/fish/completions/scansion.fish";

pub(super) const MERGE: &str = "Example:
  scansion merge tile_*.laz -o all.laz";

pub(super) const DIFF: &str = "Example:
  scansion diff my.laz classified.laz                        what changed, and where";

pub(super) const FEATURES: &str = "Examples:
  scansion features --list
  scansion features my.laz -o features.npy                   one row a point, for numpy
  scansion features my.laz -o shape.laz --optimal --neighbours 10,100
  scansion features my.laz -o shape.laz --only Planarity,Verticality --set features.pyramid.first_scale=0.25";

pub(super) const NORMALS: &str = "Examples:
  scansion normals my.laz -o normals.laz
  scansion normals room.e57 -o normals.ply --orientation 2.5,-1,1.7     towards the scanner
  scansion render normals.laz -o normals.png --by NormalZ

All else in LAS and LAZ stays as it is, byte for byte. Normals of stray points and of those without finite coordinates are NaN.";

pub(super) const TRAIN: &str = "Examples:
  scansion train a.laz b.laz -o my.model
  scansion train a.laz -o my.model --set 'features.dimensions=[\"Amplitude\"]'
  scansion train a.laz -o my.model --map 3-4=5 --classes 2,5,6 --cross-validate 5
  scansion train street.laz --weak --weak-labels picked.csv -o street.model           a few labels per class
  scansion train a.laz --recipe objects -o objects.model                              classifies segments
  scansion train streets.laz --add-cars-to built-in --cars 64 -o cars.model           finds cars as well

scansion model show my.model --recipe prints all settings that --set and --recipe know.";

pub(super) const CLASSIFY: &str = "Examples:
  scansion classify my.laz -o classified.laz                 with the built-in model for airborne scans
  scansion classify *.laz -m my.model -o classified/         many files into a folder
  scansion classify my.laz -o classified.laz --only-unclassified --keep 9,17
  scansion classify my.laz -o classified.laz --regularize segment-crf --set regularise.strength=2";

pub(super) const REGULARIZE: &str = "Examples:
  scansion classify my.laz -o named.laz --probabilities --regularize none
  scansion regularize named.laz -o smooth.laz --method point-crf --strength 2
  scansion regularize votes.ply -o smooth.ply --probabilities roof=6,road=2,tree=5";

pub(super) const SEGMENT: &str = "Examples:
  scansion segment my.laz -o segments.laz --segments-per-hectare 200
  scansion segment my.laz -o segments.laz --method vccs --size 0.8
  scansion segment my.laz -o segments.laz --method riemannian --levels 4,5,6,7
  scansion render segments.laz -o segments.png --by ClusterID";

pub(super) const SUGGEST: &str = "Examples:
  scansion suggest my.laz -n 30 -o page.html -o segments.laz     a page to label on, and its segments
  scansion train segments.laz --weak --weak-labels labels.csv -o my.model
  scansion suggest segments.laz -n 30 -m my.model --weak-labels labels.csv -o page2.html   the next round
  scansion train segments.laz --weak --weak-labels labels.csv --weak-labels labels2.csv -o better.model

The first round takes segments that are unlike each other; with a model, those it is unsure of. In the page, keys give the
classes of --offer, and the browser keeps the choices.";

pub(super) const TERRAIN: &str = "Examples:
  scansion terrain my.laz -o dtm.tif                         heights of the ground, 1 m cells
  scansion terrain my.laz -o dtm.tif --dsm dsm.tif --chm chm.tif --cell 0.5
  scansion terrain my.laz -o dtm.asc --ground-filter         for clouds without classes
  scansion terrain my.laz --contours heights.dxf --interval 0.5     a line every half metre (in feet: every half foot)
  scansion terrain classified.laz --footprints buildings.gpkg
  scansion terrain tiles/*.laz -o dtm.tif                    one model of all tiles, without seams

Rasters and outlines have the coordinates, the unit and the reference system of the cloud: in a cloud in feet, heights
are feet. --cell and the other lengths are metres; cells of 3 ft are --cell 0.9144, those of
3 US survey feet --cell 0.9144018288036576.";

pub(super) const CONTOURS: &str = "Examples:
  scansion contours my.laz -o edges.dxf                      for drawing programs
  scansion contours classified.laz -o edges.gpkg             a layer for each pair of classes, with length and confidence
  scansion contours room.e57 -o edges.geojson --voxel 0.05   finer edges
  scansion contours my.laz -o edges.ply --set trace.tidy.least_length=1

Lengths in settings are those for voxels of 0.1 m and change with the voxel: with voxels of 0.5 m, least_length=1 leaves out
lines below 5 m. Only --voxel is in metres.";

pub(super) const HEIGHT: &str = "Examples:
  scansion height my.laz -o heights.laz
  scansion height my.laz -o heights.laz --ground-classes 2,9
  scansion render heights.laz -o heights.png --by HeightAboveGround

Heights are in the unit of the cloud's own heights, as in PDAL. All else in LAS and LAZ stays as it is, byte for byte.";

pub(super) const FILTER: &str = "Examples:
  scansion filter my.laz -o clean.laz --outliers statistical         without noise
  scansion filter my.laz -o marked.laz --outliers radius --radius 2 --mark   noise gets class 7
  scansion filter my.laz -o trees.laz --classes 3,4,5 --height 2..50
  scansion filter my.laz -o site.laz --polygon site.geojson
  scansion filter my.laz -o rest.laz --polygon \"POLYGON ((0 0, 9 0, 9 9, 0 0))\" --outside

The filters are applied in this order, each to the points that those before it left: classes, outliers (statistical,
then radius), height, bounds, polygon. Fields, extra dimensions, header and records of LAS and LAZ are kept.";

pub(super) const EVALUATE: &str = "Examples:
  scansion evaluate truth.laz classified.laz                 same points in the same order
  scansion evaluate truth.laz classified.laz -o scores.json -o confusion.png
  scansion evaluate truth.laz --model my.model --map-truth 3-4=5   classify the first cloud, then compare
  scansion evaluate rooms.ply classified.ply --map-truth 0=2,1=5,2=6  where truth and prediction have other codes";

pub(super) const RENDER: &str = "Examples:
  scansion render classified.laz -o map.png                  classes from above, with a world file for GIS
  scansion render classified.laz -o side.png --view oblique --azimuth 120 --elevation 25
  scansion render classified.laz -o entropy.png --by Entropy
  scansion render classified.laz -o wrong.png --truth truth.laz --classes 2,5,6  where the classes differ
  scansion render my.laz -o lines.png --contours edges.geojson     lines over the cloud";

pub(super) const MODEL: &str = "Examples:
  scansion model show                                        the built-in model
  scansion model show my.model --recipe > my.toml            all settings, to change and to train with again";
