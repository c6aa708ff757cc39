"""The marker scan: which places to visit, looking at the frames, and from sightings to places in the apartment."""
