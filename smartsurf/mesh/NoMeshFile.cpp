// MeshFile.h where there is no importer.
#include "smartsurf/mesh/MeshFile.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {

TriangleMesh read_mesh(const std::filesystem::path&) {
  throw scene::InputError("this build reads no mesh files");
}

}  // namespace smartsurf::mesh
