"""Image formation: from the radiance of a scene to the mean rate of electrons in every pixel.

Its files in the order in which they are read best:

    photon_rate           the whole of it: layers of light, gains, veiling glare
    optical_path          what it is given, and what it hands on
    transfer_functions    polychromatic transfer functions H_kc of scene component k in color c
    strategies            which computation suits which scene

    harmonic_scenes       sinusoids, and patterns that repeat: harmonic by harmonic
    box_average           no blur: means over the photodetectors

    settings              what the tolerance asks of everything below
    bandwidth             margin of a chart, and how far up the spectrum anything counts
    chart_cells           cells on which a chart is painted
    far_field             coarse cells far from a small array
    scene_spectrum        DCT of samples, or of rectangles in closed form
    power_spectrum        mean squares by frequency
    scene_sampling        a scene's spectrum, and where it may end
    transfer_tables       H_kc of few mixtures of components, over |f| or (fx, fy)
    field_dependence      the same for a blur that changes over the field
    cosine_series         one axis: cosines, aliasing, transforms to the pixels
    filtering             spectrum times transfer function, folded onto the pixels
    effect_changes        what each blur changes in the image

    pixelwise             what each gain, glare, charge and limit changes in it
    memory_model          memory of an image, beforehand
    rate_cache            light kept for cameras that differ only in what comes after
"""
