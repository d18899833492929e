#include "smartsurf/mesh/MeshFile.h"

#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <assimp/Exporter.hpp>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>

#include "smartsurf/mesh/SolidLibrary.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

namespace fs = std::filesystem;

class MeshFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder = fs::path(testing::TempDir()) / ("smartsurf-mesh-" + std::to_string(getpid())) /
             testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder);
    fs::create_directories(folder);
  }
  void TearDown() override { fs::remove_all(folder.parent_path()); }

  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder / name, std::ios::binary) << text;
    return folder / name;
  }
  std::string bytes_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  // Writes the mesh with assimp's exporters.
  fs::path export_mesh(const TriangleMesh& mesh, const std::string& format, const std::string& name) {
    aiScene scene;
    scene.mRootNode = new aiNode("root");
    aiNode* node = new aiNode("part");  // the 3MF exporter writes only children of the root
    node->mNumMeshes = 1;
    node->mMeshes = new unsigned[1]{0};
    scene.mRootNode->addChildren(1, &node);
    scene.mNumMaterials = 1;
    scene.mMaterials = new aiMaterial* [1] { new aiMaterial };
    scene.mNumMeshes = 1;
    auto* const part = new aiMesh;
    scene.mMeshes = new aiMesh* [1] { part };
    part->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
    part->mNumVertices = static_cast<unsigned>(mesh.points.size());
    part->mVertices = new aiVector3D[mesh.points.size()];
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
      const Eigen::Vector3f p = mesh.points[i].cast<float>();
      part->mVertices[i] = {p.x(), p.y(), p.z()};
    }
    part->mNumFaces = static_cast<unsigned>(mesh.triangles.size());
    part->mFaces = new aiFace[mesh.triangles.size()];
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const auto& t = mesh.triangles[i];
      part->mFaces[i].mNumIndices = 3;
      part->mFaces[i].mIndices = new unsigned[3]{t[0], t[1], t[2]};
    }
    Assimp::Exporter exporter;
    EXPECT_EQ(exporter.Export(&scene, format, (folder / name).string()), AI_SUCCESS)
        << exporter.GetErrorString();
    return folder / name;
  }

  fs::path folder;
};

constexpr const char* kOpenCube =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
    "f 1 3 4 2\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

TEST_F(MeshFileTest, AllFormatsGiveSameSolid) {
  struct Format {
    const char *exporter, *name;
  };
  for (const Format& f : {Format{"stl", "a.stl"}, Format{"stlb", "b.stl"}, Format{"obj", "c.obj"},
                          Format{"ply", "d.ply"}, Format{"plyb", "e.ply"}, Format{"gltf2", "f.gltf"},
                          Format{"glb2", "g.glb"}, Format{"3mf", "h.3mf"}}) {
    SCOPED_TRACE(f.name);
    const fs::path file = export_mesh(l_mesh(), f.exporter, f.name);
    SolidLibrary library;
    const scene::SolidResult made = library.load_mesh({.file = file, .display_name = f.name});
    EXPECT_TRUE(made.warnings.empty());
    EXPECT_NEAR(made.solid->volume, 5.0, 1e-5);
    EXPECT_EQ(made.solid->vertices.size(), 12U);
    EXPECT_EQ(made.solid->hulls.size(), 2U);
    EXPECT_LT((made.solid->bounds_max - Eigen::Vector3f(1.9F, 1.9F, 0.5F)).norm(), 1e-5F);
  }
}

TEST_F(MeshFileTest, CachesEqualRequests) {
  const fs::path file = export_mesh(l_mesh(), "stl", "l.stl");
  SolidLibrary library;
  const auto first = library.load_mesh({.file = file, .display_name = "l.stl"}).solid;
  EXPECT_EQ(library.load_mesh({.file = file, .display_name = "l.stl"}).solid, first);
  EXPECT_NE(library.load_mesh({.file = file, .display_name = "l.stl", .scale = 2.0}).solid, first);
  EXPECT_NE(library.make_hull({.file = file, .display_name = "l.stl"}).solid, first);
  EXPECT_NEAR(library.load_mesh({.file = file, .display_name = "l.stl", .scale = 2.0}).solid->volume, 40.0,
              1e-4);
  const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  EXPECT_EQ(library.make_hull(points, "hull").solid, library.make_hull(points, "hull").solid);
}

TEST_F(MeshFileTest, HullAcceptsOpenMesh) {
  SolidLibrary library;
  const fs::path file = write("open.obj", kOpenCube);
  EXPECT_NEAR(library.make_hull({.file = file, .display_name = "open.obj"}).solid->volume, 1.0, 1e-6);
  EXPECT_EQ(error_message_of([&] { library.load_mesh({.file = file, .display_name = "open.obj"}); })
                .find("'open.obj': the mesh is open: 4 edges have only one triangle, the first from (1, 0, "
                      "1) to (0, 0, 1)"),
            0U);
}

TEST_F(MeshFileTest, InvalidFilesGiveOneLineError) {
  const auto refused = [&](const std::string& name, const std::string& text) {
    return error_message_of([&] { read_mesh(write(name, text)); });
  };
  EXPECT_EQ(error_message_of([&] { read_mesh(folder / "none.stl"); }), "does not exist");
  EXPECT_EQ(refused("a.txt", ""), "is not a mesh file: must end in .stl, .obj, .ply, .gltf, .glb or .3mf");
  for (const char* name : {"a.stl", "a.obj", "a.ply", "a.gltf", "a.glb", "a.3mf"})
    for (const char* text :
         {"", "solid", "garbage\n\n\x01\xff", "ply\nformat ascii 1.0\nelement vertex 9\n"}) {
      const std::string error = refused(name, text);
      EXPECT_NE(error, "") << name << text;
      EXPECT_EQ(error.find('\n'), std::string::npos);
    }
  EXPECT_EQ(refused("h.ply", "ply\nformat ascii 1.0\nelement vertex 9\n"),
            "is damaged: its header has no end");
  EXPECT_NE(refused("n.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").find("not finite"), std::string::npos);
}

TEST_F(MeshFileTest, TooManyTrianglesAreRefusedUnread) {
  const std::string announced = " triangles, more than 1000000: simplify it; a few thousand are enough";
  const fs::path ply = write("many.ply",
                             "ply\nformat ascii 1.0\nelement vertex 9\nelement face 1000001\n"
                             "property list uchar int vertex_indices\nend_header\n");
  EXPECT_EQ(error_message_of([&] { read_mesh(ply); }), "has 1000001" + announced);
  const std::uint32_t count = 2'000'000;
  std::string head(84, '\0');
  std::memcpy(head.data() + 80, &count, sizeof count);
  const fs::path stl = write("many.stl", head);
  fs::resize_file(stl, 84 + 50 * std::uintmax_t{count});
  EXPECT_EQ(error_message_of([&] { read_mesh(stl); }), "has 2000000" + announced);
}

TEST_F(MeshFileTest, DamagedFilesDoNotCrash) {
  for (const auto& [format, name] : std::map<std::string, std::string>{{"stl", "a.stl"},
                                                                       {"stlb", "b.stl"},
                                                                       {"obj", "c.obj"},
                                                                       {"ply", "d.ply"},
                                                                       {"plyb", "e.ply"},
                                                                       {"glb2", "g.glb"}}) {
    const std::string whole = bytes_of(export_mesh(tetrahedron(), format, name));
    for (std::size_t keep = 0; keep < whole.size(); keep += 1 + whole.size() / 20) {
      write(name, whole.substr(0, keep));
      EXPECT_NO_FATAL_FAILURE(error_message_of([&] { read_mesh(folder / name); }));
    }
  }
}

TEST_F(MeshFileTest, DoesNotReadOutsideFolder) {
  const fs::path file = export_mesh(tetrahedron(), "gltf2", "part.gltf");
  ASSERT_TRUE(fs::exists(folder / "part.bin"));
  EXPECT_EQ(read_mesh(file).triangles.size(), 4U);
  fs::create_directories(folder / "inner");
  fs::copy(file, folder / "inner" / "part.gltf");
  fs::create_symlink(folder / "part.bin", folder / "inner" / "part.bin");
  EXPECT_NE(error_message_of([&] { read_mesh(folder / "inner" / "part.gltf"); }), "");
}

// Without a word the importer would take the file of that base name beside the mesh.
TEST_F(MeshFileTest, RefusesReferencesOutOfTheFolder) {
  const std::string text = bytes_of(export_mesh(tetrahedron(), "gltf2", "part.gltf"));
  const std::size_t at = text.find("part.bin");
  ASSERT_NE(at, text.npos);
  fs::create_directories(folder / "other");
  fs::copy(folder / "part.bin", folder / "other" / "part.bin");
  for (const std::string& uri :
       {std::string("../part.bin"), std::string("other/part.bin"), std::string("%2e%2e/part.bin"),
        (folder / "other" / "part.bin").string(), "file://" + (folder / "other" / "part.bin").string()}) {
    const fs::path file = write("moved.gltf", std::string(text).replace(at, 8, uri));
    EXPECT_EQ(error_message_of([&] { read_mesh(file); }),
              "refers to '" + uri + "', which is not in the mesh's folder");
  }
  for (const std::string& uri :
       {std::string("%2e%2e%2fpart.bin"), std::string("%2E%2E/part.bin"), std::string("other%2Fpart.bin"),
        "%2F" + (folder / "part.bin").string().substr(1), std::string("file%3a%2f%2f/part.bin")}) {
    fs::create_directories(folder / "inner");
    const fs::path file = write("inner/moved.gltf", std::string(text).replace(at, 8, uri));
    fs::create_directories(folder / "inner" / "other");
    fs::copy(folder / "part.bin", folder / "inner" / "other", fs::copy_options::overwrite_existing);
    EXPECT_EQ(error_message_of([&] { read_mesh(file); }),
              "refers to '" + uri + "', which is not in the mesh's folder");
  }
  const std::string faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  EXPECT_EQ(read_mesh(write("m.obj", "mtllib ../m.mtl\n" + faces)).triangles.size(), 4U);
}

TEST_F(MeshFileTest, DecodesUrisOfGltf) {
  const std::string text = bytes_of(export_mesh(tetrahedron(), "gltf2", "part.gltf"));
  const std::size_t at = text.find("part.bin");
  const auto read_with = [&](const std::string& name, const std::string& uri) {
    fs::copy(folder / "part.bin", folder / name, fs::copy_options::overwrite_existing);
    return read_mesh(write("moved 100%41.gltf", std::string(text).replace(at, 8, uri))).triangles.size();
  };
  EXPECT_EQ(read_with("the part.bin", "the%20part.bin"), 4U);
  EXPECT_EQ(read_with("the part.bin", "the part.bin"), 4U);
  EXPECT_EQ(read_with("1%2.bin", "1%252%2Ebin"), 4U);
  EXPECT_EQ(read_with("100%", "100%"), 4U);
  EXPECT_EQ(read_with("M\xC3\xBCll", "M%C3%BCll"), 4U);
  EXPECT_EQ(read_with("literal%20.bin", "literal%20.bin"), 4U);
}

TEST_F(MeshFileTest, RefusesGltfThatItWouldMisread) {
  const std::string text = bytes_of(export_mesh(tetrahedron(), "gltf2", "part.gltf"));
  const auto refused = [&](const std::string& changed) {
    return error_message_of([&] { read_mesh(write("part.gltf", changed)); });
  };
  const auto requiring = [&](const std::string& extension) {
    return R"({"extensionsRequired": [")" + extension + "\"]," + text.substr(text.find('{') + 1);
  };
  EXPECT_EQ(refused(requiring("EXT_meshopt_compression")),
            "needs the glTF extension EXT_meshopt_compression, which is not supported: export it without");
  for (const char* extension : {"KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual",
                                "KHR_mesh_quantization", "KHR_draco_mesh_compression"})
    EXPECT_EQ(refused(requiring(extension)), "") << extension;
  std::string quantized = text;
  const std::size_t positions = quantized.find("5126");
  ASSERT_NE(positions, text.npos);
  quantized.replace(positions, 4, "5122");
  const std::string message =
      "has positions that are not 32-bit floats: export it without quantization (KHR_mesh_quantization)";
  EXPECT_EQ(refused(quantized), message);

  std::string binary = bytes_of(export_mesh(tetrahedron(), "glb2", "part.glb"));
  binary.replace(binary.find("5126"), 4, "5123");
  EXPECT_EQ(error_message_of([&] { read_mesh(write("part.glb", binary)); }), message);
}

TEST_F(MeshFileTest, LeavesOutByteOrderMark) {
  const std::string mark = "\xEF\xBB\xBF";
  for (const auto& [format, name] : std::map<std::string, std::string>{
           {"stl", "a.stl"}, {"obj", "b.obj"}, {"ply", "c.ply"}, {"plyb", "d.ply"}, {"gltf2", "e.gltf"}}) {
    SCOPED_TRACE(name);
    const fs::path file = export_mesh(tetrahedron(), format, name);
    const TriangleMesh plain = read_mesh(file);
    const TriangleMesh marked = read_mesh(write(name, mark + bytes_of(file)));
    EXPECT_EQ(marked.points, plain.points);
    EXPECT_EQ(marked.triangles, plain.triangles);
  }
  const std::string faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  EXPECT_EQ(read_mesh(write("f.obj", mark + faces)).triangles.size(), 4U);
  EXPECT_EQ(error_message_of(
                [&] { read_mesh(write("h.ply", mark + "ply\nformat ascii 1.0\nelement vertex 9\n")); }),
            "is damaged: its header has no end");
}

}  // namespace
}  // namespace smartsurf::mesh
