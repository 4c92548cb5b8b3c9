//! An offline page for labelling segments: two pictures of each, and a table to save.

use super::Suggestion;
use crate::classes::{ClassTable, preset};
use crate::cloud::{Cloud, Column, Values, names};
use crate::error::Result;
use crate::images::{ColourBy, RenderParams, View, render};
use crate::parallel::Monitor;
use crate::recipes::Segmented;
use base64::prelude::{BASE64_STANDARD, Engine};
use std::fmt::Write;

/// Largest number of points in a picture.
const MOST: usize = 60_000;
/// Colour of the segment, and of its surroundings.
const OWN: [u8; 3] = [214, 39, 100];
const OTHER: [u8; 3] = [196, 199, 203];
/// Class codes offered by the page.
const CODES: [u8; 14] = [2, 3, 4, 5, 6, 7, 9, 10, 11, 13, 14, 15, 17, 64];

/// An HTML page for labelling the suggested segments without a network: each from above and from the side, a list of
/// classes, and a button that saves the table `cluster_id,class` for [`LabelFile`](crate::recipes::LabelFile).
///
/// # Errors
/// If the work was cancelled.
pub fn suggestion_page(
    found: &[Suggestion],
    cloud: &Cloud,
    segmented: &Segmented,
    monitor: &Monitor,
) -> Result<String> {
    monitor.stage("pictures", found.len() as u64);
    let mut figures = String::new();
    for suggestion in found {
        monitor.check()?;
        figures.push_str(&figure(suggestion, cloud, segmented, monitor)?);
        monitor.advance(1);
    }
    let options: String =
        CODES.iter().map(|&c| format!("<option value=\"{c}\">{c} {}</option>", preset::asprs(c).name)).collect();
    Ok(TEMPLATE.replace("{figures}", &figures).replace("{options}", &options))
}

fn figure(suggestion: &Suggestion, cloud: &Cloud, segmented: &Segmented, monitor: &Monitor) -> Result<String> {
    let around = around(suggestion, cloud, segmented)?;
    let side = View::Oblique { azimuth_deg: 30.0, elevation_deg: 30.0 };
    let mut text = format!(
        "<article data-id=\"{id}\"><h2>segment {id}</h2><p>{} points, uncertainty {:.2}</p>",
        suggestion.points,
        suggestion.uncertainty,
        id = suggestion.cluster_id
    );
    for (view, name) in [(View::Map, "from above"), (side, "from the side")] {
        let params = RenderParams {
            view,
            by: ColourBy::Colour,
            width: 420,
            height: Some(320),
            legend: false,
            ..RenderParams::default()
        };
        let picture = render(&around, &ClassTable::default(), &params, &Monitor::default())?.to_png(monitor)?;
        let picture = BASE64_STANDARD.encode(picture);
        let _ = write!(text, "<img alt=\"{name}\" src=\"data:image/png;base64,{picture}\">");
    }
    text.push_str("<select><option value=\"\">(class)</option></select></article>\n");
    Ok(text)
}

/// The segment in colour and its surroundings in grey, thinned if there are many points.
fn around(suggestion: &Suggestion, cloud: &Cloud, segmented: &Segmented) -> Result<Cloud> {
    let own = |i: &u32| segmented.clusters[*i as usize] == suggestion.cluster_id;
    let finite = segmented.points.frame.index.iter().copied();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for i in finite.clone().filter(own) {
        let p = cloud.xyz(i as usize);
        (0..3).for_each(|a| (low[a], high[a]) = (low[a].min(p[a]), high[a].max(p[a])));
    }
    let margin = (0.6 * (high[0] - low[0]).max(high[1] - low[1])).max(4.0);
    let near = |i: &u32| {
        let p = cloud.xyz(*i as usize);
        (0..2).all(|a| low[a] - margin <= p[a] && p[a] <= high[a] + margin)
    };
    let near: Vec<u32> = finite.filter(near).collect();
    let kept: Vec<u32> = near.iter().copied().step_by(near.len().div_ceil(MOST).max(1)).collect();
    let mut around = Cloud::from_rows(&kept.iter().map(|&i| cloud.xyz(i as usize)).collect::<Vec<_>>())?;
    for (channel, name) in names::COLOUR.into_iter().enumerate() {
        let values = kept.iter().map(|i| if own(i) { OWN[channel] } else { OTHER[channel] }).collect();
        around.set_column(Column::new(name, Values::U8(values)))?;
    }
    Ok(around)
}

const TEMPLATE: &str = r#"<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Segments to label</title>
<style>
body{font:15px/1.4 system-ui,sans-serif;margin:2rem;background:#fafafa;color:#222}
article{display:inline-block;vertical-align:top;background:#fff;border:1px solid #ddd;border-radius:6px;margin:0 1rem 1rem 0;padding:1rem;width:420px}
h1{margin-top:0}h2{font-size:1rem;margin:0}p{margin:.2rem 0 .6rem;color:#555}img{display:block;width:100%;margin-bottom:.5rem}
select,button{font:inherit;padding:.3rem .6rem}nav{position:sticky;top:0;background:#fafafa;padding:.5rem 0;z-index:1}
</style></head><body>
<h1>Segments whose labels would help most</h1>
<p>Give a class to those that you know (the segment is the coloured part), save the table, and learn from it:
<code>scansion train --weak SEGMENTS.laz --weak-labels labels.csv -o my.model</code></p>
<nav><button id="save">save labels.csv</button> <span id="done"></span></nav>
{figures}
<template>{options}</template>
<script>
const all=[...document.querySelectorAll('article')];
const options=document.querySelector('template').innerHTML;
const count=()=>{document.getElementById('done').textContent=all.filter(a=>a.querySelector('select').value).length+' of '+all.length+' named'};
all.forEach(a=>{const s=a.querySelector('select');s.insertAdjacentHTML('beforeend',options);s.addEventListener('change',count)});
count();
document.getElementById('save').onclick=()=>{
  const rows=all.map(a=>[a.dataset.id,a.querySelector('select').value]).filter(r=>r[1]).map(r=>r.join(','));
  const link=document.createElement('a');
  link.href=URL.createObjectURL(new Blob(['cluster_id,class\n'+rows.join('\n')+'\n'],{type:'text/csv'}));
  link.download='labels.csv';link.click();
};
</script></body></html>
"#;
