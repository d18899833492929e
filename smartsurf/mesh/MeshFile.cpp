#include "smartsurf/mesh/MeshFile.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/DefaultIOSystem.h>
#include <assimp/MemoryIOWrapper.h>
#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string_view>
#include <system_error>

#include "common/files/Inputs.h"
#include "common/process/ChildWork.h"
#include "common/text/Utf8.h"
#include "common/text/Words.h"
#include "smartsurf/mesh/ByteString.h"
#include "smartsurf/mesh/GltfCheck.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxFileBytes = 256U << 20;
constexpr std::size_t kMaxTriangles = 1'000'000;
constexpr std::size_t kMaxResultBytes = std::size_t{1} << 30;
// Address space of the importer: a compressed or a text file grows in memory.
constexpr std::size_t kImporterBytes = std::size_t{1} << 30, kImporterBytesPerByte = 16;
constexpr const char* kNeedsMemory = "needs more memory than a reader of meshes may have";

[[noreturn]] void refuse(const std::string& clause) { throw scene::InputError(clause); }

using common::kByteOrderMark;

// OBJ's importer takes the mark for part of the first word.
bool has_byte_order_mark(const fs::path& file) {
  std::string start(kByteOrderMark.size(), '\0');
  std::ifstream(file, std::ios::binary).read(start.data(), static_cast<std::streamsize>(start.size()));
  return start == kByteOrderMark;
}

// Restricts files that a mesh refers to (materials, buffers) to its folder, after resolving symbolic links.
// Leaves out the mesh's byte-order mark, and takes references of glTF for percent-encoded URIs.
class FolderIoSystem final : public Assimp::DefaultIOSystem {
 public:
  explicit FolderIoSystem(const fs::path& mesh)
      : mesh_(mesh.string()),
        folder_(fs::weakly_canonical(mesh).parent_path()),
        has_byte_order_mark_(has_byte_order_mark(mesh)),
        refers_by_uri_(common::lower_case(mesh.extension().string()) == ".gltf" ||
                       common::lower_case(mesh.extension().string()) == ".glb") {}
  bool Exists(const char* reference) const override {
    const std::string file = file_of(reference);
    return is_allowed(file) && DefaultIOSystem::Exists(file.c_str());
  }
  Assimp::IOStream* Open(const char* reference, const char* mode) override {
    const std::string file = file_of(reference);
    if (outside_.empty() && !is_inside(file)) outside_ = reference;
    if (!is_allowed(file) || mode[0] != 'r') return nullptr;
    return file == mesh_ && has_byte_order_mark_ ? open_behind_mark()
                                                 : DefaultIOSystem::Open(file.c_str(), mode);
  }
  // The first file outside of the folder that was asked for, or "". The importer then tries its base name.
  const std::string& outside() const { return outside_; }

 private:
  bool is_inside(const std::string& file) const {
    std::error_code error;
    return fs::weakly_canonical(file, error).parent_path() == folder_ && !error;
  }
  bool is_allowed(const std::string& file) const {
    std::error_code error;
    return is_inside(file) && fs::is_regular_file(file, error);
  }
  // A file whose name is as the reference goes before that of the decoded one.
  std::string file_of(const std::string& reference) const {
    const std::string start = mesh_.substr(0, mesh_.rfind('/') + 1);
    if (!refers_by_uri_ || !reference.starts_with(start) || is_allowed(reference)) return reference;
    return start + decode_uri(reference.substr(start.size()));
  }
  Assimp::IOStream* open_behind_mark() const {
    std::ifstream in(mesh_, std::ios::binary);
    in.seekg(kByteOrderMark.size());
    const std::string text(std::istreambuf_iterator<char>(in), {});
    auto* const bytes = new std::uint8_t[text.size()];
    std::memcpy(bytes, text.data(), text.size());
    return new Assimp::MemoryIOStream(bytes, text.size(), true);
  }

  std::string mesh_;
  fs::path folder_;
  bool has_byte_order_mark_, refers_by_uri_;
  std::string outside_;
};

void check_extension(const fs::path& file) {
  const std::string extension = common::lower_case(file.extension().string());
  for (const char* known : {".stl", ".obj", ".ply", ".gltf", ".glb", ".3mf"})
    if (extension == known) return;
  refuse("is not a mesh file: must end in .stl, .obj, .ply, .gltf, .glb or .3mf");
}

void check_readable(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) refuse("does not exist");
  if (!fs::is_regular_file(file, error)) refuse("is not a regular file");
  if (fs::file_size(file, error) > kMaxFileBytes) refuse("is larger than 256 MiB");
  common::note_input(file);
}

void check_triangle_count(std::uint64_t count) {
  if (count > kMaxTriangles)
    refuse("has " + std::to_string(count) + " triangles, more than " + std::to_string(kMaxTriangles) +
           ": simplify it; a few thousand are enough");
}

// The number of faces that a PLY header announces, 0 if none.
std::uint64_t ply_face_count(const std::string& start) {
  constexpr std::string_view kFaces = "\nelement face ";
  const std::size_t at = start.find(kFaces);
  return at == start.npos ? 0 : std::strtoull(start.c_str() + at + kFaces.size(), nullptr, 10);
}

// The number of triangles of a binary STL file, 0 for others.
std::uint64_t binary_stl_triangle_count(const std::string& start, std::uintmax_t file_bytes) {
  constexpr std::size_t kTitleBytes = 80, kBytesPerTriangle = 50;
  std::uint32_t count = 0;
  if (start.size() < kTitleBytes + sizeof count) return 0;
  std::memcpy(&count, start.data() + kTitleBytes, sizeof count);
  return file_bytes == kTitleBytes + sizeof count + kBytesPerTriangle * std::uintmax_t{count} ? count : 0;
}

// Rejects a PLY header without an end, in which the importer would loop forever, and too many triangles
// before they are read. The importer detects PLY by content, whatever the extension.
void check_header(const fs::path& file) {
  std::string start(16384, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(in.gcount());
  if (start.starts_with(kByteOrderMark)) start.erase(0, kByteOrderMark.size());
  if (start.starts_with("ply") && start.find("end_header\n") == start.npos &&
      start.find("end_header\r") == start.npos)
    refuse("is damaged: its header has no end");
  if (start.starts_with("ply")) check_triangle_count(ply_face_count(start));
  if (common::lower_case(file.extension().string()) == ".stl")
    check_triangle_count(binary_stl_triangle_count(start, fs::file_size(file)));
}

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  return text.substr(0, 200);
}

void add(TriangleMesh& mesh, const aiMesh& part, const aiMatrix4x4& pose) {
  const auto first = static_cast<std::uint32_t>(mesh.points.size());
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    const aiVector3D p = pose * part.mVertices[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      refuse("has a vertex that is not finite: number " + std::to_string(mesh.points.size() + 1));
    mesh.points.emplace_back(p.x, p.y, p.z);
  }
  const bool mirrored = pose.Determinant() < 0;
  for (unsigned f = 0; f < part.mNumFaces; ++f) {
    const aiFace& face = part.mFaces[f];
    if (face.mNumIndices != 3) continue;
    const unsigned* i = face.mIndices;
    if (std::max({i[0], i[1], i[2]}) >= part.mNumVertices)
      refuse("is damaged: a face refers to a vertex that does not exist");
    mesh.triangles.push_back({first + i[0], first + i[mirrored ? 2 : 1], first + i[mirrored ? 1 : 2]});
  }
  check_triangle_count(mesh.triangles.size());
}

void add(TriangleMesh& mesh, const aiScene& scene, const aiNode& node, const aiMatrix4x4& parent_pose) {
  const aiMatrix4x4 pose = parent_pose * node.mTransformation;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) add(mesh, *scene.mMeshes[node.mMeshes[i]], pose);
  for (unsigned i = 0; i < node.mNumChildren; ++i) add(mesh, scene, *node.mChildren[i], pose);
}

// An OBJ may name materials anywhere, which are not read; of other formats it would be geometry.
void check_references(const fs::path& file, std::string outside) {
  if (outside.empty() || common::lower_case(file.extension().string()) == ".obj") return;
  const std::string folder = file.parent_path().string() + "/";
  if (outside.starts_with(folder)) outside.erase(0, folder.size());
  refuse("refers to '" + outside + "', which is not in the mesh's folder");
}

TriangleMesh import_mesh(const fs::path& file) {
  check_gltf(file);
  Assimp::Importer importer;
  auto* const files = new FolderIoSystem(file);
  importer.SetIOHandler(files);  // takes ownership
  // Keep only positions; other attributes would split points that have several normals or texture
  // coordinates.
  importer.SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS,
                              aiComponent_NORMALS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_COLORS |
                                  aiComponent_TEXCOORDS | aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS |
                                  aiComponent_TEXTURES | aiComponent_LIGHTS | aiComponent_CAMERAS);
  const aiScene* scene = nullptr;
  try {
    scene = importer.ReadFile(file.string(), aiProcess_RemoveComponent | aiProcess_Triangulate);
  } catch (const std::exception& e) {
    refuse("cannot be read: " + one_line(e.what()));
  }
  check_references(file, files->outside());
  if (scene == nullptr || scene->mRootNode == nullptr) {
    const std::string reason = importer.GetErrorString();
    if (reason.empty()) refuse("is damaged: the importer finds no mesh in it");
    refuse(reason == std::bad_alloc().what() ? kNeedsMemory : "cannot be read: " + one_line(reason));
  }
  std::uint64_t faces = 0;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) faces += scene->mMeshes[i]->mNumFaces;
  check_triangle_count(faces);
  TriangleMesh mesh;
  add(mesh, *scene, *scene->mRootNode, aiMatrix4x4());
  if (mesh.points.empty()) refuse("has no vertices");
  return mesh;
}

// The child process returns bytes: 'm', two counts and the arrays of a mesh, or 'e' and an error message.
std::string serialize(const TriangleMesh& mesh) {
  const std::uint64_t counts[] = {mesh.points.size(), mesh.triangles.size()};
  std::string bytes = "m";
  append(bytes, counts, 2);
  append(bytes, mesh.points.data(), mesh.points.size());
  append(bytes, mesh.triangles.data(), mesh.triangles.size());
  return bytes;
}

// The child has read a hostile file and may return anything.
TriangleMesh deserialize(const std::string& bytes) {
  TriangleMesh mesh;
  std::uint64_t counts[2] = {};
  const std::size_t head = 1 + sizeof counts;
  if (bytes.size() >= head) std::memcpy(counts, bytes.data() + 1, sizeof counts);
  if (counts[0] == 0 || counts[0] > kMaxResultBytes || counts[1] > kMaxTriangles ||
      bytes.size() != head + counts[0] * sizeof(Eigen::Vector3d) + counts[1] * sizeof(mesh.triangles[0]))
    refuse("is damaged: the mesh importer failed");
  mesh.points.resize(counts[0]);
  mesh.triangles.resize(counts[1]);
  const char* at = bytes.data() + 1 + sizeof counts;
  const std::size_t point_bytes = mesh.points.size() * sizeof(Eigen::Vector3d);
  if (!mesh.points.empty()) std::memcpy(static_cast<void*>(mesh.points.data()), at, point_bytes);
  if (!mesh.triangles.empty())
    std::memcpy(mesh.triangles.data(), at + point_bytes, mesh.triangles.size() * sizeof(mesh.triangles[0]));
  for (const Eigen::Vector3d& point : mesh.points)
    if (!point.allFinite()) refuse("is damaged: the mesh importer failed");
  for (const auto& triangle : mesh.triangles)
    if (std::max({triangle[0], triangle[1], triangle[2]}) >= mesh.points.size())
      refuse("is damaged: the mesh importer failed");
  return mesh;
}

}  // namespace

TriangleMesh read_mesh(const fs::path& file) {
  constexpr double kMaxReadCpu_s = 20.0;
  check_extension(file);
  check_readable(file);
  check_header(file);
  const common::ChildResult read = common::run_in_child(
      [&]() -> std::string {
        try {
          return serialize(import_mesh(file));
        } catch (const scene::InputError& e) {
          return std::string("e") + e.what();
        }
      },
      {kMaxReadCpu_s,
       kImporterBytes + kImporterBytesPerByte * fs::file_size(file),
       {file, fs::weakly_canonical(file).parent_path()},
       kMaxResultBytes});
  if (read.end == common::ChildResult::End::kStopped) refuse("was not read: interrupted");
  if (read.end == common::ChildResult::End::kOutOfMemory) refuse(kNeedsMemory);
  if (read.end != common::ChildResult::End::kReturned || read.bytes.empty())
    refuse("is damaged or too large: the mesh importer failed");
  if (read.bytes.front() == 'e') refuse(one_line(read.bytes.substr(1)));
  return deserialize(read.bytes);
}

}  // namespace smartsurf::mesh
