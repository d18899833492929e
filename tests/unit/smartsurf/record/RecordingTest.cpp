#include "smartsurf/record/Recording.h"

#include <gtest/gtest.h>
#include <hdf5.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <sstream>

#include "smartsurf/record/hdf5/Structure.h"
#include "smartsurf/scene/KindRegistry.h"
#include "tests/unit/common/SanitizedCases.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

#ifdef __SANITIZE_ADDRESS__
// Each read asks for 16 MB first, of which the quarantine would keep fifteen: forks would take twice as long.
extern "C" [[gnu::visibility("default")]] const char* __asan_default_options() {
  return "quarantine_size_mb=16";
}
#endif

namespace smartsurf::record {
namespace {

std::string error_of(const std::filesystem::path& path) {
  try {
    const Recording recording = Recording::open(path);
    for (std::size_t f = 0; f < recording.frames(); ++f) recording.read_snapshot(f);
  } catch (const scene::InputError& error) {
    return error.what();
  }
  return "";
}

std::string write_run(const std::filesystem::path& path, std::uint64_t ticks = 100) {
  const SyntheticRun run;
  const auto recorder = open_recorder(path, run.meta, run.spec);
  for (std::uint64_t t = 0; t < ticks; ++t) {
    const NamedNumber lift{"lift", 0.1 * static_cast<double>(t)};
    recorder->record_frame(run.snapshot_at(t, {0, 1, 2}), run.spec.objects, {}, {}, {&lift, 1});
  }
  recorder->close({.outcome = "done",
                   .ticks = ticks,
                   .simulated_s = 1.5,
                   .state_hash = 0x1F,
                   .success = true,
                   .success_s = 0.5333,
                   .metrics = {{"lift", 12.5}, {"error", 7.0}}});
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

void expect_error(const std::filesystem::path& path, const std::string& part) {
  const std::string error = error_of(path);
  EXPECT_EQ(error.substr(0, path.string().size() + 2), path.string() + ": ");
  EXPECT_NE(error.find(part), std::string::npos) << error;
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

TEST(Recording, RejectsOtherFiles) {
  const OutputFolder out;
  expect_error(out / "none.h5", "no such file");
  std::filesystem::create_directory(out / "folder.h5");
  expect_error(out / "folder.h5", "is not a regular file");
  write_bytes(out / "empty.h5", "");
  expect_error(out / "empty.h5", "is not an HDF5 file");
  write_bytes(out / "text.h5", "tick,time\n1,2\n");
  expect_error(out / "text.h5", "is not an HDF5 file");
  write_bytes(out / "run.csv", "tick,time\n1,2\n");
  expect_error(out / "run.csv", "is a CSV recording");
  H5Fclose(H5Fcreate((out / "foreign.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT));
  expect_error(out / "foreign.h5", "has no group meta");
}

TEST(Recording, RejectsTruncatedFile) {
  const OutputFolder out;
  const std::string whole = write_run(out / "run.h5");
  for (const double share : {0.2, 0.5, 0.9, 0.999}) {
    write_bytes(out / "cut.h5",
                whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
    expect_error(out / "cut.h5", "");
  }
}

TEST(Recording, NamesMissingPart) {
  const OutputFolder out;
  for (const char* part : {"time", "objects/label", "objects/velocity", "surface", "meta/options"}) {
    write_run(out / "run.h5");
    const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(H5Ldelete(file, part, H5P_DEFAULT), 0);
    H5Fclose(file);
    const std::string name = part;
    expect_error(out / "run.h5", name.substr(name.find('/') + 1));
  }
}

TEST(Recording, OpensFileWithoutAngularVelocities) {
  const OutputFolder out;
  write_run(out / "run.h5");
  EXPECT_TRUE(Recording::open(out / "run.h5").has_angular_velocities());
  const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  ASSERT_GE(H5Ldelete(file, "objects/angular_velocity", H5P_DEFAULT), 0);
  H5Fclose(file);
  const Recording recording = Recording::open(out / "run.h5");
  ASSERT_EQ(recording.frames(), 100u);
  EXPECT_FALSE(recording.has_angular_velocities());
  const scene::Snapshot read = recording.read_snapshot(7), written = SyntheticRun().snapshot_at(7, {0, 1, 2});
  EXPECT_EQ(read.velocity, written.velocity);
  ASSERT_EQ(read.angular_velocity.size(), 3u);
  for (const auto& w : read.angular_velocity) EXPECT_TRUE(std::isnan(w[0]));
}

TEST(Recording, IgnoresImplausibleExtents) {
  const OutputFolder out;
  write_run(out / "run.h5");
  const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  for (const char* name : {"tick", "time", "hash", "contacts", "objects/position", "objects/orientation",
                           "objects/velocity", "objects/angular_velocity"}) {
    const hid_t dataset = H5Dopen2(file, name, H5P_DEFAULT);
    const hsize_t huge[] = {hsize_t{1} << 40, 3, 3};
    const hsize_t huge_orientation[] = {hsize_t{1} << 40, 3, 4};
    H5Dset_extent(dataset, std::string(name) == "objects/orientation" ? huge_orientation : huge);
    H5Dclose(dataset);
  }
  H5Fclose(file);
  EXPECT_EQ(Recording::open(out / "run.h5").frames(), 100u);
}

// Readers take every frame to have a height for each cell.
TEST(Recording, HasTheFramesThatHaveHeights) {
  const OutputFolder out;
  write_run(out / "run.h5");
  hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t rows = H5Dopen2(file, "surface/changes/end", H5P_DEFAULT);
  const hsize_t few = 40;
  ASSERT_GE(H5Dset_extent(rows, &few), 0);
  H5Dclose(rows);
  H5Fclose(file);
  const Recording shorter = Recording::open(out / "run.h5");
  ASSERT_EQ(shorter.frames(), 40u);
  EXPECT_EQ(shorter.times().size(), 40u);
  EXPECT_EQ(shorter.read_snapshot(39).height, SyntheticRun().snapshot_at(39, {0, 1, 2}).height);

  write_run(out / "without.h5");
  file = H5Fopen((out / "without.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  ASSERT_GE(H5Ldelete(file, "surface/changes", H5P_DEFAULT), 0);
  H5Fclose(file);
  const Recording without = Recording::open(out / "without.h5");
  EXPECT_EQ(without.frames(), 100u);
  EXPECT_FALSE(without.has_heights());
  EXPECT_EQ(without.read_snapshot(7).height, std::vector<float>(24, 0.0F));
}

// Each damaged file is opened in a forked child first, and AddressSanitizer makes fork() slow. Under it
// recording_fuzz_replay reads a hundred others.
constexpr int kDamages = cases(120, 10);

// A damaged byte gives a result or a one-line error, never a crash.
TEST(Recording, SurvivesDamagedBytes) {
  const OutputFolder out;
  const std::string whole = write_run(out / "run.h5", 20);
  std::uint32_t random = 1;
  int refused = 0;
  for (int i = 0; i < kDamages; ++i) {
    std::string damaged = whole;
    random = random * 1664525u + 1013904223u;
    damaged[(random >> 4) % std::min<std::size_t>(whole.size(), 30000)] ^= static_cast<char>(1 + i % 255);
    write_bytes(out / "damaged.h5", damaged);
    const std::string error = error_of(out / "damaged.h5");
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    refused += !error.empty();
  }
  EXPECT_GT(refused, kDamages / 15);
}

TEST(Recording, RejectsFileThatCrashesHdf5) {
  const OutputFolder out;
  std::string bytes = write_run(out / "run.h5");
  // Corrupts the length of the first string in the global heap. It is at offset 24, after the heap's
  // signature, version and size (16 bytes) and the string's index and reference count (8 bytes).
  const std::size_t heap = bytes.find("GCOL");
  ASSERT_NE(heap, std::string::npos);
  bytes.replace(heap + 24, 8, std::string("\xFF\xFF\xFF\xFF\xFF\xFF\x00\x00", 8));
  write_bytes(out / "damaged.h5", bytes);
  expect_error(out / "damaged.h5", "damaged");
}

// The module unregisters external links, so that this test has to register them again to make one.
void make_external_link(const std::filesystem::path& target, hid_t file, const char* name) {
  H5L_class_t links{};
  links.version = H5L_LINK_CLASS_T_VERS;
  links.id = H5L_TYPE_EXTERNAL;
  links.comment = "external";
  links.trav_func = [](const char*, hid_t, const void*, size_t, hid_t, hid_t) -> hid_t { return -1; };
  ASSERT_GE(H5Lregister(&links), 0);
  EXPECT_GE(H5Ldelete(file, name, H5P_DEFAULT), 0);
  EXPECT_GE(H5Lcreate_external(target.c_str(), name, file, name, H5P_DEFAULT, H5P_DEFAULT), 0);
  EXPECT_GE(H5Lunregister(H5L_TYPE_EXTERNAL), 0);
}

TEST(Recording, FollowsNothingToOtherFiles) {
  const OutputFolder out;
  write_run(out / "other.h5");
  write_run(out / "link.h5");
  hid_t file = H5Fopen((out / "link.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  make_external_link(out / "other.h5", file, "tick");
  H5Fclose(file);
  expect_error(out / "link.h5", "has no dataset tick");

  write_run(out / "storage.h5");
  write_bytes(out / "secret", std::string(400, 'x'));
  file = H5Fopen((out / "storage.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  H5Ldelete(file, "contacts", H5P_DEFAULT);
  const hsize_t size = 100;
  const hid_t space = H5Screate_simple(1, &size, nullptr), properties = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_external(properties, (out / "secret").c_str(), 0, 400);
  const hid_t dataset =
      H5Dcreate2(file, "contacts", H5T_NATIVE_UINT32, space, H5P_DEFAULT, properties, H5P_DEFAULT);
  EXPECT_GE(dataset, 0);
  H5Dclose(dataset);
  H5Pclose(properties);
  H5Sclose(space);
  H5Fclose(file);
  expect_error(out / "storage.h5", "dataset contacts is stored in another file");
}

// Limits of what HDF5 takes long for.
TEST(Recording, BoundsDepthObjectsAndAttributes) {
  const OutputFolder out;
  const auto make = [&](const char* name, const auto& change) {
    write_run(out / name);
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);  // adds attributes in linear time
    const hid_t file = H5Fopen((out / name).c_str(), H5F_ACC_RDWR, access);
    H5Pclose(access);
    change(file);
    H5Fclose(file);
    return out / name;
  };
  const auto nest = [](int depth) {
    return [depth](hid_t file) {
      hid_t group = H5Gopen2(file, "metrics", H5P_DEFAULT);
      for (int i = 1; i < depth; ++i) {
        const hid_t below = H5Gcreate2(group, "g", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
        H5Gclose(group);
        group = below;
      }
      H5Gclose(group);
    };
  };
  EXPECT_EQ(error_of(make("nested.h5", nest(kMaxDepth))), "");
  expect_error(make("deep.h5", nest(kMaxDepth + 1)),
               "has groups in more than 16 levels, the most that are read");
  const auto add_attributes = [](hsize_t count) {
    return [count](hid_t file) {
      H5Ldelete(file, "meta/options", H5P_DEFAULT);
      const hid_t group = H5Gcreate2(file, "meta/options", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                  space = H5Screate(H5S_SCALAR);
      for (hsize_t i = 0; i < count; ++i)
        H5Aclose(H5Acreate2(group, ("a" + std::to_string(i)).c_str(), H5T_NATIVE_INT, space, H5P_DEFAULT,
                            H5P_DEFAULT));
      H5Sclose(space);
      H5Gclose(group);
    };
  };
  expect_error(make("attributes.h5", add_attributes(kMaxAttributes + 1)),
               "/meta/options has 8001 attributes; at most 8000 are read");
  expect_error(make("links.h5",
                    [](hid_t file) {
                      for (hsize_t i = 0; i < kMaxObjects; ++i)
                        H5Lcreate_soft("/tick", file, ("metrics/s" + std::to_string(i)).c_str(), H5P_DEFAULT,
                                       H5P_DEFAULT);
                    }),
               "has more than 200000 objects, the most that are read");
}

// A part that cannot be looked up is not taken for one that was not recorded.
TEST(Recording, FailedLookupIsAnError) {
  const OutputFolder out;
  write_run(out / "run.h5");
  const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  ASSERT_GE(H5Ldelete(file, "objects", H5P_DEFAULT), 0);
  ASSERT_GE(H5Lcreate_hard(file, "tick", file, "objects", H5P_DEFAULT, H5P_DEFAULT), 0);
  H5Fclose(file);
  expect_error(out / "run.h5", "objects/position cannot be looked up");
}

TEST(Recording, DescriptionHasNoControlCharacters) {
  const OutputFolder out;
  SyntheticRun run;
  run.meta.command_line =
      "smartsurf \x1b[31m\x07 run\nstate hash  forged \xc2\x9b"
      "1m ä";
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  recorder->record_frame(run.snapshot_at(0, {0, 1, 2}), run.spec.objects);
  recorder->close({"done\x1b]0;title\x07"});
  const std::string text = describe_recording(Recording::open(out / "run.h5"));
  for (const char c : text) EXPECT_TRUE(c == '\n' || (static_cast<unsigned char>(c) >= 0x20 && c != 0x7f));
  EXPECT_NE(text.find("smartsurf ?[31m? run?state hash  forged ?1m ä"), std::string::npos) << text;
}

TEST(Recording, Describe) {
  const OutputFolder out;
  write_run(out / "run.h5");
  const std::string text = describe_recording(Recording::open(out / "run.h5"));
  for (const char* part :
       {"run.h5 (", "smartsurf 0.", "bullet 3.24",
        "command     smartsurf run scripts/experiment.lua --seed 7\n", "experiment  scripts/experiment.lua\n",
        "program     sort.aps\n", "count = 3, speed = 0.5", "seed        18446744073709551601\n",
        "time-step mode", "4 rows × 6 columns, pitch 2 u", "border 5 u",
        "objects     3: 1 unlabelled (box, size 1 × 2 × 3 u), 1 'large' (cylinder, radius 4 u), 1 'small' "
        "(sphere, "
        "radius 2 u)",
        "frames      100, ticks 0 to 99, 0 s to 1.65 s, every tick", "done after 100 ticks, 1.5 s simulated",
        "000000000000001f at the end",
        "metric      error: 7 at the end\nmetric      lift: 0 at the start, 12.5 at the end\n",
        "success     at 0.5333 s\n"})
    EXPECT_NE(text.find(part), std::string::npos) << part << " is missing in\n" << text;
  EXPECT_EQ(text.find("/objects/position"), std::string::npos) << text;
  EXPECT_NE(list_datasets(Recording::open(out / "run.h5"))
                .find("/objects/position                   100 × 3 × 3\n"),
            std::string::npos);
}

// Each metric has values in frames or not, and at the end a value, none (NaN) or nothing that is stored.
TEST(Recording, DescribesMetricsAtTheEnd) {
  const OutputFolder out;
  std::mt19937 random(3);
  const auto number = [&random] { return static_cast<double>(random() % 2000) / 8.0 - 125.0; };
  const auto shown = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", value);
    return std::string(text);
  };
  SyntheticRun run;
  run.spec.record.tick_interval = 7;
  for (int ticks = 1; ticks < 40; ticks += 6) {
    std::vector<NamedNumber> metrics, at_end;
    std::vector<std::vector<double>> values;  // of each metric in frames, by tick
    for (int kind = 0; kind < 6; ++kind) {
      const std::string name = "m" + std::to_string(kind);
      if (kind % 2 == 0) metrics.emplace_back(name, 0.0);
      if (kind / 2 != 0) at_end.emplace_back(name, kind / 2 == 1 ? NAN : number());
    }
    const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
    for (int t = 0; t < ticks; ++t) {
      values.emplace_back();
      for (auto& [name, value] : metrics) values.back().push_back(value = number());
      recorder->record_frame(run.snapshot_at(t, {0}), run.spec.objects, {}, {}, metrics);
    }
    recorder->close({.outcome = "done", .metrics = at_end});
    const auto lines_of = [&](const char* file) {
      std::istringstream text(describe_recording(Recording::open(out / file)));
      std::string lines;
      for (std::string line; std::getline(text, line);)
        if (line.starts_with("metric")) lines += line.substr(12) + "\n";
      return lines;
    };
    const auto start = [&](int metric) { return shown(values[0][metric]) + " at the start, "; };
    const auto last_frame = [&](int metric) {
      return shown(values[(ticks - 1) / 7 * 7][metric]) + " at the last frame\n";
    };
    EXPECT_EQ(lines_of("run.h5"), "m0: " + start(0) + last_frame(0) + "m2: " + start(1) +
                                      "none at the end\nm4: " + start(2) + shown(at_end[2].second) +
                                      " at the end\nm5: " + shown(at_end[3].second) + " at the end\n");
    const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(H5Ldelete(file, "meta/metrics", H5P_DEFAULT), 0);  // an older recording
    H5Fclose(file);
    EXPECT_EQ(lines_of("run.h5"), "m0: " + start(0) + last_frame(0) + "m2: " + start(1) + last_frame(1) +
                                      "m4: " + start(2) + last_frame(2));
  }
}

TEST(Recording, RefusesMetricsThatAreNoNumbers) {
  const OutputFolder out;
  for (const bool text : {false, true}) {
    write_run(out / "run.h5");
    const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t group = H5Gopen2(file, "meta/metrics", H5P_DEFAULT);
    const hsize_t many = 5;
    const hid_t space = text ? H5Screate(H5S_SCALAR) : H5Screate_simple(1, &many, nullptr);
    H5Aclose(
        H5Acreate2(group, "forged", text ? H5T_C_S1 : H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT));
    H5Sclose(space);
    H5Gclose(group);
    H5Fclose(file);
    expect_error(out / "run.h5", "attribute forged");
  }
}

// A solid of two hulls, a wedge and a box. Volume and inertia are arbitrary.
std::shared_ptr<const scene::Solid> two_hull_solid() {
  scene::Solid solid;
  solid.source = "part.stl";
  solid.volume = 1.5;
  solid.inertia << 1, 0.25, 0, 0.25, 2, 0, 0, 0, 3;
  solid.vertices = {{-1, -1, -1}, {2, -1, -1}, {-1, 1, -1}, {-1, -1, 4}};
  solid.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  solid.hulls.push_back(scene::make_convex_hull(solid.vertices, {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3},
                                                std::vector<std::uint32_t>{3, 3, 3, 3}));
  std::vector<Eigen::Vector3f> box;
  for (int i = 0; i < 8; ++i) box.emplace_back(i & 1, (i >> 1) & 1, i >> 2);
  solid.hulls.push_back(
      scene::make_convex_hull(box, {0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5},
                              std::vector<std::uint32_t>(6, 4)));
  scene::compute_bounds(solid);
  return std::make_shared<const scene::Solid>(solid);
}

void write_shapes(const std::filesystem::path& path) {
  SyntheticRun run;
  run.add(scene::ShapeKind::kCapsule, "pill", 0.5);
  run.add(scene::ShapeKind::kCone, "hat", 1.5);
  run.spec.objects[4].height = 4.0;
  const auto solid = two_hull_solid();
  for (int i = 0; i < 2; ++i) {
    run.add(scene::ShapeKind::kSolid, "part", 1.0);
    run.spec.objects.back().solid = solid;
  }
  const auto recorder = open_recorder(path, run.meta, run.spec);
  std::vector<scene::ObjectSpec> all = run.spec.objects;
  recorder->record_frame(run.snapshot_at(0, {0, 1, 2, 3, 4, 5, 6}), all);
  all.push_back(all.back());  // added during the run: one with a stored solid, one with a new solid
  all.push_back(all.back());
  all.back().solid = two_hull_solid();
  recorder->record_frame(run.snapshot_at(1, {0, 1, 2, 3, 4, 5, 6, 7, 8}), all);
  recorder->close({});
}

TEST(Recording, KeepsEveryShapeAndSharesSolids) {
  const OutputFolder out;
  write_shapes(out / "run.h5");
  const Recording recording = Recording::open(out / "run.h5");
  const auto& objects = recording.spec().objects;
  ASSERT_EQ(objects.size(), 9U);
  EXPECT_EQ(objects[3].shape, scene::ShapeKind::kCapsule);
  EXPECT_EQ(objects[3].radius, 0.5);
  EXPECT_EQ(objects[3].height, 3.0);
  EXPECT_EQ(objects[4].shape, scene::ShapeKind::kCone);
  EXPECT_EQ(objects[4].height, 4.0);
  ASSERT_EQ(objects[5].shape, scene::ShapeKind::kSolid);
  EXPECT_EQ(objects[5].solid, objects[6].solid);
  EXPECT_EQ(objects[5].solid, objects[7].solid);
  EXPECT_NE(objects[5].solid, objects[8].solid);
  EXPECT_EQ(objects[0].solid, nullptr);

  const auto right = two_hull_solid();
  const scene::Solid& solid = *objects[8].solid;
  EXPECT_EQ(solid.source, "part.stl");
  EXPECT_EQ(solid.volume, 1.5);
  EXPECT_EQ(solid.inertia, right->inertia);
  EXPECT_EQ(solid.vertices, right->vertices);
  EXPECT_EQ(solid.triangles, right->triangles);
  EXPECT_EQ(solid.bounding_radius, right->bounding_radius);
  ASSERT_EQ(solid.hulls.size(), 2U);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(solid.hulls[i].vertices, right->hulls[i].vertices);
    EXPECT_EQ(solid.hulls[i].face_vertices, right->hulls[i].face_vertices);
    EXPECT_EQ(solid.hulls[i].edges, right->hulls[i].edges);
    EXPECT_EQ(solid.hulls[i].unique_normals, right->hulls[i].unique_normals);
    EXPECT_EQ(solid.hulls[i].faces[1].offset, right->hulls[i].faces[1].offset);
  }
  const std::string text = describe_recording(recording);
  EXPECT_NE(text.find("4 'part' (solid, width 2.5 u)"), std::string::npos) << text;
  EXPECT_NE(text.find("1 'hat' (cone, radius 1.5 u), 1 'large'"), std::string::npos) << text;
  EXPECT_EQ(text.find("purity"), std::string::npos) << "there are five labels:\n" << text;
}

TEST(Recording, RejectsInvalidSolids) {
  const OutputFolder out;
  const auto damage = [&](const char* name, hid_t type, const void* value) {
    write_shapes(out / "run.h5");
    const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t dataset = H5Dopen2(file, name, H5P_DEFAULT), space = H5Dget_space(dataset);
    const hsize_t first[] = {0, 0}, one[] = {1, 1};
    H5Sselect_hyperslab(space, H5S_SELECT_SET, first, nullptr, one, nullptr);
    const hid_t memory = H5Screate_simple(1, one, nullptr);
    EXPECT_GE(H5Dwrite(dataset, type, memory, space, H5P_DEFAULT, value), 0);
    H5Sclose(memory);
    H5Sclose(space);
    H5Dclose(dataset);
    H5Fclose(file);
  };
  const std::uint32_t many = 4000000000U;
  const std::uint16_t far = 60000;
  const float nan = NAN;
  const int none = -1;
  damage("solids/0/triangles", H5T_NATIVE_UINT32, &many);
  expect_error(out / "run.h5", "has a vertex index out of range");
  damage("solids/0/vertices", H5T_NATIVE_FLOAT, &nan);
  expect_error(out / "run.h5", "not finite");
  for (const char* count : {"solids/0/corner_count", "solids/0/face_count", "solids/0/face_size"}) {
    damage(count, H5T_NATIVE_UINT32, &many);
    expect_error(out / "run.h5", "incomplete");
  }
  damage("solids/1/face_corners", H5T_NATIVE_UINT16, &far);
  expect_error(out / "run.h5", "not a polyhedron");
  damage("objects/solid", H5T_NATIVE_INT32, &none);  // ignored: object 0 is a sphere
  EXPECT_EQ(Recording::open(out / "run.h5").spec().objects.size(), 9U);
}

TEST(Recording, DescribesRunWithoutFrames) {
  const OutputFolder out;
  write_run(out / "run.h5", 0);
  const std::string text = describe_recording(Recording::open(out / "run.h5"));
  EXPECT_NE(text.find("frames      0\n"), std::string::npos) << text;
}

// A free layout with two kinds of actuators and empty cells, whose actuator states change every tick.
struct LaidOutRun : SyntheticRun {
  LaidOutRun() {
    scene::ActuatorSpec wheels = scene::find_actuator_kind("wheels")->default_spec();
    wheels.values["angle"] = {0.5};
    spec.surface.actuators = {scene::find_actuator_kind("ball")->default_spec(), wheels};
    for (scene::ActuatorSpec& spec_of : spec.surface.actuators) spec_of.values["top"] = {1.5, 0.8};
    for (int i = 0; i < spec.surface.cell_count(); ++i) {
      spec.surface.actuator_of_cell.push_back(static_cast<std::int8_t>(i % 3 - 1));
      spec.surface.cell_poses.push_back({1.5 * i, -0.25 * i, 0.125 * i});
      spec.surface.base_heights.push_back(0.5F * static_cast<float>(i));
    }
  }
  scene::Snapshot snapshot_at(std::uint64_t tick) const {
    scene::Snapshot shot = SyntheticRun::snapshot_at(tick, {0});
    for (int i = 0; i < spec.surface.cell_count(); ++i)
      shot.actuator_state.push_back({static_cast<float>(tick), static_cast<float>(i), 0.25F});
    return shot;
  }
};

TEST(Recording, KeepsLayoutActuatorsAndTheirStates) {
  const OutputFolder out;
  const LaidOutRun run;
  const auto recorder = open_recorder(out / "run.h5", run.meta, run.spec);
  for (std::uint64_t t = 0; t < 5; ++t) recorder->record_frame(run.snapshot_at(t), run.spec.objects);
  recorder->close({.outcome = "done"});
  const Recording recording = Recording::open(out / "run.h5");
  const scene::SurfaceSpec& surface = recording.spec().surface;
  ASSERT_EQ(surface.actuators.size(), 2u);
  EXPECT_EQ(surface.actuators[1].model, "wheels");
  EXPECT_EQ(surface.actuators[1].number("angle"), 0.5);
  EXPECT_EQ(surface.actuator_of_cell, run.spec.surface.actuator_of_cell);
  EXPECT_EQ(surface.base_heights, run.spec.surface.base_heights);
  ASSERT_EQ(surface.cell_poses.size(), 24u);
  EXPECT_EQ(surface.cell_poses[7].x, 10.5);
  EXPECT_EQ(surface.cell_poses[7].angle, 0.875);
  EXPECT_EQ(surface.centre(1, 1), Eigen::Vector2d(10.5, -1.75));
  ASSERT_TRUE(recording.has_motion());
  EXPECT_EQ(recording.read_snapshot(3).actuator_state[5].a, 3.0F);
  EXPECT_EQ(recording.read_snapshot(3).actuator_state[5].b, 5.0F);
  EXPECT_EQ(recording.read_snapshot(1).actuator_state[5].a, 1.0F) << "going back";
}

TEST(Recording, PinGridHasNoLayout) {
  const OutputFolder out;
  write_run(out / "run.h5", 3);
  const Recording recording = Recording::open(out / "run.h5");
  EXPECT_FALSE(recording.has_motion());
  EXPECT_TRUE(recording.spec().surface.cell_poses.empty());
  EXPECT_TRUE(recording.read_snapshot(0).actuator_state.empty());
}

TEST(Recording, OpensOlderFileWithoutLayout) {
  const OutputFolder out;
  write_run(out / "run.h5", 3);
  const hid_t file = H5Fopen((out / "run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  H5Ldelete(file, "surface/mechanisms", H5P_DEFAULT);
  H5Fclose(file);
  EXPECT_EQ(error_of(out / "run.h5"), "");
  EXPECT_EQ(Recording::open(out / "run.h5").spec().surface.effective_actuators()[0].model, "pin");
}

}  // namespace
}  // namespace smartsurf::record
