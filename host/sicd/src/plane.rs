//! Image plane of a SICD as a grid about the scene centre point.

use subaperture_io::container::{self, Element};
use subaperture_io::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::geometry::{Axis, ImageGrid, SceneFrame};

use crate::lookup;

/// Image plane: rows along the y axis (the file's `Row` direction), columns along the x axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Pixel grid, metres from the scene centre point.
    pub grid: ImageGrid,
    /// Frame: scene centre point and the plane's axes.
    pub frame: SceneFrame,
    /// Bandwidth along columns, cycles per pixel; `None` if not stated or above 1.
    pub column_band: Option<f64>,
}

impl Plane {
    /// Parse the XML of an image of `rows` x `columns`; `None` if the plane is missing or invalid.
    pub(crate) fn of(xml: &str, (rows, columns): (usize, usize)) -> Option<Self> {
        let document = container::parse(xml, DEFAULT_MEMORY_BYTES).ok()?;
        let root = Element::root(&document);
        let value = |path: &[&str]| lookup::number(root, path);
        let vector = |path: &[&str]| root.find(path)?.xyz().ok();
        let first = |name| value(&["ImageData", name]).unwrap_or(0.0);
        let axis = |name: &str, first: f64, count| {
            let step = value(&["Grid", name, "SS"])?;
            let centre = value(&["ImageData", "SCPPixel", name])?;
            Some(Axis {
                start: (first - centre) * step,
                step,
                count,
            })
        };
        let grid = ImageGrid::horizontal(
            axis("Col", first("FirstCol"), columns)?,
            axis("Row", first("FirstRow"), rows)?,
            0.0,
        );
        let frame = SceneFrame::Earth {
            origin_ecf_m: vector(&["GeoData", "SCP", "ECF"])?,
            x_axis_ecf: vector(&["Grid", "Col", "UVectECF"])?,
            y_axis_ecf: vector(&["Grid", "Row", "UVectECF"])?,
        };
        let band = value(&["Grid", "Col", "ImpRespBW"]).map(|band| band * grid.columns.step);
        (grid.fault().is_none() && frame.is_sound()).then_some(Self {
            grid,
            frame,
            column_band: band.filter(|band| *band > 0.0 && *band <= 1.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const XML: &str = r#"<SICD xmlns="urn:SICD:1.3.0"><ImageData><FirstRow>10</FirstRow><FirstCol>0</FirstCol><SCPPixel><Row>30</Row><Col>5</Col></SCPPixel></ImageData>
        <GeoData><SCP><ECF><X>6378137</X><Y>0</Y><Z>0</Z></ECF></SCP></GeoData>
        <Grid><Row><UVectECF><X>0</X><Y>0</Y><Z>1</Z></UVectECF><SS>0.5</SS></Row><Col><UVectECF><X>0</X><Y>1</Y><Z>0</Z></UVectECF><SS>2</SS><ImpRespBW>0.4</ImpRespBW></Col></Grid></SICD>"#;

    #[test]
    fn plane_places_pixels_about_scene_centre_point() {
        let plane = Plane::of(XML, (100, 50)).unwrap();
        assert_eq!(plane.grid.position_m(20, 5), DVec3::ZERO);
        let at = plane.frame.to_ecf_m(plane.grid.position_m(22, 6));
        // Two rows of 0.5 m along z, one column of 2 m along y.
        assert!(at.distance(DVec3::new(6_378_137.0, 2.0, 1.0)) < 1e-9);
        assert_eq!(plane.column_band, Some(0.8));
        for (from, to) in [
            ("<SS>2</SS>", ""),
            ("<SS>2</SS>", "<SS>-2</SS>"),
            ("<Y>1</Y>", "<Y>2</Y>"),
            ("6378137", "x"),
        ] {
            assert_eq!(Plane::of(&XML.replace(from, to), (100, 50)), None, "{from}");
        }
    }
}
