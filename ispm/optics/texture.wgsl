// Twin of texture.py in name only: textures are bound one by one (WebGPU has no bindless), so the hardware
// samples them, with textureSampleLevel. The parity test holds the two to the same filter.
