"""The definition of what a viewer asks beside features and tiles."""

from trigpoint.landmarks.tile_grid import ZOOM_MOST
from trigpoint_landmarks.http.anchor_advice import (
    IMAGE_SIGMA_M,
    SIGMA_LEAST_M,
    SIGMA_M,
    SIGMA_MOST_M,
    SUGGESTIONS,
    SUGGESTIONS_MOST,
    TEXT_LIMIT,
)
from trigpoint_landmarks.http.documents import GEOJSON, JSON, JsonObject
from trigpoint_landmarks.http.driven import SOURCES
from trigpoint_landmarks.http.event_stream import KIND
from trigpoint_landmarks.http.event_stream import PATH as EVENTS_PATH
from trigpoint_landmarks.http.openapi_parts import AS_OF, JSON_ONLY, WHOLE, getting, object_with, path_part, query
from trigpoint_landmarks.http.openapi_parts import responses as answers
from trigpoint_landmarks.http.rasters import PICTURES
from trigpoint_landmarks.http.viewer_api import ACCESS_PATH

TAG = "viewer"
TEXT: JsonObject = {"type": "string"}
SHORT: JsonObject = {"type": "string", "maxLength": TEXT_LIMIT}
TRUTH: JsonObject = {"type": "boolean"}
NUMBER: JsonObject = {"type": "number", "nullable": True}
VERSION: JsonObject = {"type": "integer", "nullable": True}
POSITION: JsonObject = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2, "nullable": True}
SIGMAS = (
    query(
        "sigma_m",
        "The label's 1-sigma per axis",
        {"type": "number", "minimum": SIGMA_LEAST_M, "maximum": SIGMA_MOST_M, "default": SIGMA_M},
    ),
    query(
        "image_sigma_m",
        "That of a new image's own place; 0: a survey",
        {"type": "number", "minimum": 0.0, "maximum": SIGMA_MOST_M, "default": IMAGE_SIGMA_M},
    ),
)
DRIVE = query("drive", "Of this drive only: its vehicle and boot with a colon between", TEXT)


def viewer_paths() -> JsonObject:
    """The paths of what a viewer asks."""
    return {**_advice_paths(), **_log_paths(), **_raster_paths(), **_shift_paths(), **_service_paths()}


def _shaped(**properties: JsonObject) -> JsonObject:
    """An object that has all these properties."""
    return {**object_with(*properties), "properties": properties}


def _list(item: JsonObject) -> JsonObject:
    return {"type": "array", "items": item}


def _label_parameters() -> tuple[JsonObject, ...]:
    """What is asked of a label."""
    degrees = (
        {**query("lat_deg", "Its latitude", {"type": "number", "minimum": -90, "maximum": 90}), "required": True},
        {**query("lon_deg", "Its longitude", {"type": "number", "minimum": -180, "maximum": 180}), "required": True},
    )
    texts = (
        query("image", "The image it is labelled in; none: a survey", SHORT),
        query("kind", "What it is; the solve does not look at it", TEXT),
        query("signature", "Its known identity", SHORT),
        query("anchor", "Its name: a label of it in this image is replaced", SHORT),
    )
    return (*degrees, *SIGMAS, *texts)


def _advice_paths() -> JsonObject:
    limit = {"type": "integer", "minimum": 1, "maximum": SUGGESTIONS_MOST, "default": SUGGESTIONS}
    return {
        "/association": getting(
            "association",
            "What the next solve would do with a label",
            answers(JSON, _association_schema()),
            *_label_parameters(),
            AS_OF,
            JSON_ONLY,
            tag=TAG,
        ),
        "/anchor-suggestions": getting(
            "anchor_suggestions",
            "Where one more anchor would help most",
            answers(JSON, _suggestions_schema()),
            query("limit", "At most so many", limit),
            *SIGMAS,
            AS_OF,
            JSON_ONLY,
            tag=TAG,
        ),
        "/images": getting(
            "images", "The images' ground and offsets", answers(JSON, _images_schema()), AS_OF, JSON_ONLY, tag=TAG
        ),
    }


def _association_schema() -> JsonObject:
    return _shaped(
        map_version=VERSION,
        landmark=TEXT,
        reason=TEXT,
        distance_m=NUMBER,
        corrected_distance_m=NUMBER,
        gate_m=NUMBER,
        chi_square=NUMBER,
        chi_square_limit=NUMBER,
        landmark_position=POSITION,
        landmark_kind={**TEXT, "nullable": True},
        runner_up={**object_with("landmark", "distance_m", "position", "kind"), "nullable": True},
        already_anchored_by=_list(TEXT),
        expected_variance_reduction_m2=NUMBER,
        explanation=TEXT,
    )


def _suggestions_schema() -> JsonObject:
    one = _shaped(
        rank=WHOLE,
        landmark=TEXT,
        kind=TEXT,
        position=POSITION,
        sigma_major_m=NUMBER,
        variance_reduction_m2=NUMBER,
        share=NUMBER,
        image=TEXT,
        image_choices=_list(TEXT),
    )
    return _shaped(map_version=VERSION, summed_variance_m2=NUMBER, suggestions=_list(one), method=TEXT)


def _images_schema() -> JsonObject:
    lengths = ("offset_x_m", "offset_y_m", "sigma_major_m", "sigma_minor_m", "ellipse_heading_rad")
    one = _shaped(
        image=TEXT,
        footprint={**object_with("type", "coordinates"), "nullable": True},
        footprint_source={"type": "string", "nullable": True},
        anchor_count=WHOLE,
        **dict.fromkeys(lengths, NUMBER),
    )
    return _shaped(map_version=VERSION, images=_list(one))


def _log_paths() -> JsonObject:
    source = {**query("source", "By what", {"type": "string", "enum": list(SOURCES)}), "required": True}
    features = {"type": "array", "items": {"$ref": "#/components/schemas/Feature"}}
    paths = _shaped(type=TEXT, map_version=VERSION, features=features)
    fixes = _shaped(type=TEXT, map_version=VERSION, numberMatched=WHOLE, numberReturned=WHOLE, features=features)
    label = object_with("anchor", "image", "position", "sigma_m", "image_sigma_m", "kind", "signature", "stamp_ns")
    return {
        "/paths": getting(
            "paths",
            "Drives' paths by odometry or filter",
            answers(GEOJSON, paths),
            source,
            DRIVE,
            JSON_ONLY,
            tag=TAG,
        ),
        "/fixes": getting(
            "fixes",
            "GNSS fixes and the filter's verdicts",
            answers(GEOJSON, fixes),
            query("accepted", "Those accepted, or those refused", TRUTH),
            DRIVE,
            JSON_ONLY,
            tag=TAG,
        ),
        "/labels": getting(
            "labels", "The labels in force in the log", answers(JSON, _shaped(labels=_list(label))), JSON_ONLY, tag=TAG
        ),
    }


def _raster_paths() -> JsonObject:
    one = object_with("name", "title", "kind", "tiles", "bounds", "minzoom", "maxzoom", "tile_size", "attribution")
    binary = {"schema": {"type": "string", "format": "binary"}}
    tile = {
        **answers(PICTURES["png"], {"type": "string", "format": "binary"}),
        "200": {"description": "As asked for", "content": dict.fromkeys(PICTURES.values(), binary)},
        "204": {"description": "Nothing is in the tile"},
        "304": {"description": "It is as the client has it"},
    }
    place = (
        path_part("name", "The raster's name", {"type": "string", "minLength": 1}),
        path_part("z", "Zoom", {**WHOLE, "maximum": ZOOM_MOST}),
        path_part("x", "Column", WHOLE),
        path_part("y", "Row, with the picture's ending", {"type": "string", "pattern": r"^[0-9]+\.(png|jpg|webp)$"}),
    )
    return {
        "/rasters": getting(
            "rasters", "Pictures of the ground", answers(JSON, _shaped(rasters=_list(one))), JSON_ONLY, tag=TAG
        ),
        "/rasters/{name}/{z}/{x}/{y}": getting("raster_tile", "A picture's tile", tile, *place, JSON_ONLY, tag=TAG),
    }


def _shift_paths() -> JsonObject:
    tiles = {
        **answers(GEOJSON, object_with("type", "features")),
        "304": {"description": "It is as the client has it"},
    }
    image = path_part("image", "The image's name", {"type": "string", "minLength": 1})
    listed = answers(JSON, _shaped(shifts=_list(object_with("image", "tiles"))))
    return {
        "/shifts": getting("shifts", "Images registered to the ortho layer", listed, JSON_ONLY, tag=TAG),
        "/shifts/{image}": getting("shift_layer", "An image's shift by tiles", tiles, image, JSON_ONLY, tag=TAG),
    }


def _service_paths() -> JsonObject:
    access = _shaped(
        name=TEXT,
        scope={"type": "string", "nullable": True},
        can_read=TRUTH,
        can_label=TRUTH,
        why_not_label=TEXT,
    )
    return {
        EVENTS_PATH: getting(
            "events", "New map versions, told at once until the stream ends", answers(KIND, TEXT), tag=TAG
        ),
        ACCESS_PATH: getting("access", "What whoever asks may do", answers(JSON, access), JSON_ONLY, tag=TAG),
    }
