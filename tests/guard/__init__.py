"""Whether pictures are what they were: small scenes of all that is rendered, compared with kept arrays.

scenes    what is rendered: every light, matter, estimator, emission, kernel, preset, and how it is looked at
arrays    all that a renderer gives of a case, by name
exact     every number as it was, on one machine: `make guard`
summary   what other machines agree in, and by how much; kept in `kept.npz`, compared by `make test`
"""
