// Reads triangle meshes from STL, OBJ, PLY, glTF, GLB and 3MF files.
#pragma once

#include <filesystem>

#include "smartsurf/mesh/TriangleMesh.h"

namespace smartsurf::mesh {

// Returns all meshes of the file as one, in the file's unit and axes, with unwelded points. Reads referenced
// files from the same folder only. Throws scene::InputError, one clause without the file's name.
TriangleMesh read_mesh(const std::filesystem::path& file);

}  // namespace smartsurf::mesh
