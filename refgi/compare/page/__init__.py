"""The pages' viewer: pictures as half floats, what stands out in them, and the script that shows them.

`floats` packs planes for the script, `surface` shares what turns irradiance into radiance, `album` gathers the pictures
of a page within a limit of bytes; `detectors` and `crops` find what a reader should look at. Templates, style and
scripts lie beside them.
"""
