"""Image formation: from the radiance of a scene to the mean rate of electrons in every pixel.

Its files in the order in which they are read best:

    photon_rate           the whole of it: layers of light, gains, veiling glare
    optical_path          what it is given, and what it hands on
    transfer_functions    polychromatic transfer functions H_kc of scene component k in color c
    strategies            which computation suits which scene

    harmonic_scenes       sinusoids, and patterns that repeat: harmonic by harmonic
    box_average           no blur: means over the photodetectors

    settings              what the tolerance asks of everything below
    scene_spectrum        DCT of samples, or of rectangles in closed form
    transfer_tables       H_kc of few mixtures of components, over |f| or (fx, fy)
    field_dependence      the same for a blur that changes over the field
    cosine_series         one axis: cosines, aliasing, transforms to the pixels
    filtering             spectrum times transfer function, folded onto the pixels
    far_field             coarse cells far from a small array

    estimates/            numbers beforehand: bandwidth, cells, peaks, memory, changes
    layers/               scenes of several distances, composited front to back
    sub_exposures         images that turn or shake while they are exposed

    light_plan            which effects act on which layer of light
    timed_gains           lamps that flicker
    pixelwise             what each gain, glare, charge and limit changes in it
    rate_cache            light kept for cameras that differ only in what comes after
"""
