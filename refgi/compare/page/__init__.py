"""The pages' viewer: pictures as half floats, what stands out in them, and the script that shows them.

`floats` packs planes for the script within a limit of bytes, `album` gathers the pictures of a page and what turns
their irradiance into radiance; `detectors` finds what a reader should look at. Templates, style and scripts lie beside
them.
"""
