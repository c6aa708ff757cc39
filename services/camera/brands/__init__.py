"""One module for each brand of camera, each with the same function: `connect(address) -> Camera`.

A new brand is one new file here; the configuration names it (`brand: amcrest`).
"""
