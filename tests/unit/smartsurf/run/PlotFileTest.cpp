#include "smartsurf/run/display/PlotFile.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

// Fontconfig, which Cairo uses to find fonts, never frees its tables.
extern "C" [[gnu::visibility("default")]] const char* __lsan_default_suppressions() {
  return "leak:libfontconfig";
}

namespace smartsurf::run {
namespace {

std::string contents(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

TEST(PlotFile, WritesTableAndFigure) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "plot-file";
  std::filesystem::create_directories(folder);
  view::PlotExport plot{(folder / "a.csv").string(), {0.0, 0.5}, {{"speed:3", "u/s", {1.0, 2.0}}}};
  EXPECT_EQ(write_plot_file(plot, "sort.lua"), "wrote " + plot.file);
  EXPECT_EQ(contents(plot.file), "time_s,speed:3 [u/s]\n0,1\n0.5,2\n");
  plot.file = (folder / "a.png").string();
  plot.series.push_back({"x:3", "u", {1.0, 2.0}});
  EXPECT_EQ(write_plot_file(plot, "sort.lua"), "wrote " + plot.file);
  EXPECT_TRUE(contents(plot.file).starts_with("\x89PNG"));
  plot.file = (folder / "missing" / "a.csv").string();
  EXPECT_NE(write_plot_file(plot, "sort.lua").find("cannot be written"), std::string::npos);
  EXPECT_EQ(write_plot_file({"b.csv", {}, {}}, "sort.lua"), "there is nothing to plot yet");
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace smartsurf::run
