"""The light of a measurement: a lamp, or none."""

from typing import Any

from vcam_cli.camera.scene.illuminant import Illuminant, IlluminantSpec


class Light(Illuminant):
    """The type of the light of a measurement: a lamp, or none."""

    def read(self, given: Any) -> IlluminantSpec | None:  # type: ignore[override]
        """Return the lamp; None for none."""
        return None if given is None or given == "none" else super().read(given)

    def write(self, value: IlluminantSpec | None) -> Any:
        """Return the YAML form."""
        return "none" if value is None else value.to_yaml()

    def json_schema(self, forms: dict[str, Any]) -> dict[str, Any]:
        """Return the JSON Schema of a lamp, or of none."""
        lamp = super().json_schema(forms)
        return {"anyOf": [{"const": "none"}, *lamp["anyOf"]]}
