"""Components from files: meshes with materials, read, checked and assembled to K and M."""
