"""Print as JSON what GDAL, through pyogrio, reads from a GeoPackage: ids, fields and points of every layer."""

import json
import sys

import numpy as np
import pyogrio
import shapely


def main(path):
    layers = {}
    for name, kind in pyogrio.list_layers(path):
        meta, fids, shapes, columns = pyogrio.raw.read(
            path, layer=name, return_fids=True, read_geometry=kind is not None
        )
        described = {"kind": kind, "crs": meta["crs"], "fids": fids.tolist(), "fields": {}}
        for field, values in zip(meta["fields"], columns, strict=True):
            described["fields"][field] = [None if v != v else v for v in np.asarray(values, object).tolist()]
        if kind is not None:
            described["points"] = [shapely.get_coordinates(shape).tolist() for shape in shapely.from_wkb(shapes)]
        layers[name] = described
    json.dump(layers, sys.stdout, default=str)


if __name__ == "__main__":
    main(*sys.argv[1:])
