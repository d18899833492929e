#include "smartsurf/web/Page.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/view/model/ActuatorGeometry.h"
#include "smartsurf/web/Base64.h"
#include "smartsurf/web/SeriesEncoder.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::web {
namespace {

using record::OutputFolder;
using record::SyntheticRun;

record::Recording write_recording(const std::filesystem::path& path, SyntheticRun& run, int ticks) {
  const auto recorder = record::open_recorder(path, run.meta, run.spec);
  for (int t = 0; t < ticks; ++t)
    recorder->record_frame(run.snapshot_at(static_cast<std::uint64_t>(t), {0, 1}), run.spec.objects);
  recorder->close({"done", 0, 0.0, 0});
  return record::Recording::open(path);
}

std::string read_text(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(Page, IsSelfContained) {
  const OutputFolder out;
  SyntheticRun run;
  write_page(write_recording(out / "run.h5", run, 10), out / "run.html");
  const std::string page = read_text(out / "run.html");
  for (const char* place : {"{{TITLE}}", "{{SCENE}}", "{{FRAMES}}", "{{THREE}}", "{{PLAYER}}"})
    EXPECT_EQ(page.find(place), page.npos) << place << " was left open";
  EXPECT_NE(page.find("experiment.lua"), page.npos);
  EXPECT_NE(page.find("The MIT License"), page.npos);
  EXPECT_EQ(page.find("<script src"), page.npos);
  EXPECT_EQ(page.find("<link"), page.npos);
}

TEST(Page, FillsInDefaultsOfMechanisms) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.surface.pin.top_x = run.spec.surface.pin.top_y = 0.8;
  run.spec.surface.actuators = {scene::find_actuator_kind("pin")->default_spec(),
                                scene::find_actuator_kind("delta")->default_spec()};
  run.spec.surface.actuators[0].values["tip.shape"] = {1.0};  // a hemisphere
  write_page(write_recording(out / "run.h5", run, 3), out / "run.html");
  const std::string page = read_text(out / "run.html");
  EXPECT_NE(page.find("\"tip\":{\"height\":0.4"), page.npos);
  EXPECT_NE(page.find("\"arms\":{\"length\":2.0,\"radius\":0.5}"), page.npos);
  EXPECT_NE(page.find("\"tip\":{\"length\":0.5}"), page.npos);
}

TEST(Page, HoldsTheMeshesOfTheView) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.surface.pin.top_x = run.spec.surface.pin.top_y = 0.8;
  for (const char* model : {"ball", "wheels", "rotor", "force_field", "magnet", "air_jet", "tile", "delta"})
    run.spec.surface.actuators.push_back(scene::find_actuator_kind(model)->default_spec());
  const record::Recording recording = write_recording(out / "run.h5", run, 3);
  write_page(recording, out / "run.html");
  const std::string page = read_text(out / "run.html");
  const view::ActuatorGeometry geometry(recording.spec().surface);
  ASSERT_EQ(geometry.meshes().size(), 10u);
  for (const view::InstancedMesh& mesh : geometry.meshes()) {
    const std::vector<float>& vertices = mesh.mesh.vertices;
    const std::string text =
        base64({reinterpret_cast<const std::uint8_t*>(vertices.data()), sizeof(float) * vertices.size()});
    EXPECT_NE(page.find("\"vertices\":\"" + text + '"'), page.npos);
  }
}

TEST(Page, EscapesHostileLabels) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.objects[0].label = "</script><script>alert(1)</script>";
  run.spec.file = "<marquee>{{PLAYER}}.lua";
  write_page(write_recording(out / "run.h5", run, 3), out / "run.html");
  const std::string page = read_text(out / "run.html");
  EXPECT_EQ(page.find("<script>alert"), page.npos);
  EXPECT_EQ(page.find("<marquee>"), page.npos);
  EXPECT_NE(page.find("{{PLAYER}}"), page.npos) << "what was put in was looked at again";
}

TEST(Page, LimitsFramesPerSecond) {
  const OutputFolder out;
  SyntheticRun run;  // 60 frames per second
  const record::Recording recording = write_recording(out / "run.h5", run, 121);
  const auto times = [&](double fps) {
    write_page(recording, out / "run.html", {fps});
    const std::string page = read_text(out / "run.html");
    const std::size_t from = page.find("\"time\":["), to = page.find(']', from);
    return 1 + std::count(page.begin() + from, page.begin() + to, ',');
  };
  EXPECT_EQ(times(30.0), 61);
  EXPECT_EQ(times(10.0), 21);
  EXPECT_EQ(times(1000.0), 121);
}

// A channel with components is shown as that many channels with one.
TEST(Page, ShowsEachComponentOfAChannel) {
  const OutputFolder out;
  SyntheticRun run;
  const int rows = run.spec.surface.rows, columns = run.spec.surface.columns, components = 3;
  const std::size_t cells = run.spec.surface.cell_count();
  std::mt19937 random(3);
  std::vector<float> values(components * cells * 5);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] =
        std::uniform_real_distribution(0.0F, 1.0F + static_cast<float>(i / cells % components))(random);
  std::string pages[2];
  for (const bool apart : {false, true}) {
    const std::filesystem::path path = out / (apart ? "apart/run.h5" : "together/run.h5");
    std::filesystem::create_directory(path.parent_path());
    const auto recorder = record::open_recorder(path, run.meta, run.spec);
    for (std::uint64_t t = 0; t < 5; ++t) {
      const std::span<const float> frame =
          std::span(values).subspan(t * components * cells, components * cells);
      std::vector<scene::ChannelData> channels = {{"colour", rows, columns, components, frame}};
      if (apart)
        channels = {{"colour[0]", rows, columns, 1, frame.first(cells)},
                    {"colour[1]", rows, columns, 1, frame.subspan(cells, cells)},
                    {"colour[2]", rows, columns, 1, frame.last(cells)}};
      recorder->record_frame(run.snapshot_at(t, {0, 1}), run.spec.objects, channels, {});
    }
    recorder->close({"done", 0, 0.0, 0});
    write_page(record::Recording::open(path), out / "run.html", {1000.0});
    pages[apart] = read_text(out / "run.html");
  }
  EXPECT_NE(pages[0].find("\"name\":\"sensors/colour[2]\""), std::string::npos);
  EXPECT_TRUE(pages[0] == pages[1]);
}

TEST(Page, RejectsEmptyRecordingAndUnwritablePath) {
  const OutputFolder out;
  SyntheticRun run;
  EXPECT_THROW(write_page(write_recording(out / "none.h5", run, 0), out / "a.html"), scene::InputError);
  EXPECT_FALSE(std::filesystem::exists(out / "a.html"));
  const record::Recording recording = write_recording(out / "run.h5", run, 3);
  EXPECT_THROW(write_page(recording, out / "nowhere/a.html"), scene::InputError);
}

}  // namespace
}  // namespace smartsurf::web
