// Reads a file of triangles: STL, OBJ, PLY, glTF, GLB or 3MF.
#pragma once

#include <filesystem>

#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

// All the file's meshes as one, in the file's unit and axes, points not yet joined. Files that it refers to
// are read only from its own folder. Throws scene::InputError, one clause without the file's name.
TriangleMesh read_mesh(const std::filesystem::path& file);

}  // namespace smartsurf::mesh
