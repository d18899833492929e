#include "smartsurf/view/model/PlotData.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <set>

#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

using Kind = Signal::Kind;

TEST(Signal, TextReadsBack) {
  for (const char* text : {"speed:3", "x:0", "spin:12", "proximity:4,7", "command: height:0,63",
                           "colour[1]:2,3", "contacts", "objects", "metric:time to sort", "metric:a:b"}) {
    const auto signal = parse_signal(text);
    ASSERT_TRUE(signal) << text;
    EXPECT_EQ(to_string(*signal), text);
  }
  EXPECT_EQ(parse_signal("proximity:4,7"), (Signal{Kind::kCell, "proximity", 0, 4, 7}));
  EXPECT_EQ(parse_signal("error"), (Signal{Kind::kMetric, "error", 0, 0, 0}));
  EXPECT_EQ(parse_signal("command: height:4,7")->quantity, "command: height");
}

TEST(Signal, RefusesOtherText) {
  for (const char* text : {"", "speed", "sped:3", "speed:x", "speed:-1", "proximity:4,", "proximity:,7",
                           ":1,2", "height:-1,2", "metric:", "purity:1"})
    EXPECT_FALSE(parse_signal(text)) << text;
}

TEST(Signal, ListsAllOfAnItemWithUnits) {
  const Channel channels[] = {{"height", "u", {}}, {"proximity_hit", "", {}}};
  const auto object = signals_of({SceneItem::Kind::kObject, 5, 0, 0}, channels);
  ASSERT_EQ(object.size(), 5u);
  EXPECT_EQ(to_string(object[3]), "speed:5");
  EXPECT_EQ(unit_of(object[3], channels), "u/s");
  EXPECT_EQ(unit_of(object[4], channels), "rad/s");
  const auto cell = signals_of({SceneItem::Kind::kCell, 0, 1, 2}, channels);
  ASSERT_EQ(cell.size(), 2u);
  EXPECT_EQ(to_string(cell[1]), "proximity_hit:1,2");
  EXPECT_EQ(unit_of(cell[0], channels), "u");
}

TEST(Signal, DraggedItemBringsWhatIsPlottedOfItsLike) {
  const Channel channels[] = {{"height", "u", {}}, {"proximity", "u", {}}};
  const SceneItem ball{SceneItem::Kind::kObject, 5, 0, 0}, cell{SceneItem::Kind::kCell, 0, 1, 2};
  const auto texts = [&](const SceneItem& item, const PlotData& plotted) {
    std::vector<std::string> all;
    for (const Signal& signal : signals_to_add(item, channels, plotted)) all.push_back(to_string(signal));
    return all;
  };
  PlotData plotted;
  EXPECT_EQ(texts(ball, plotted), std::vector<std::string>{"speed:5"});
  EXPECT_EQ(texts(cell, plotted), std::vector<std::string>{"height:1,2"});
  plotted.set({*parse_signal("z:1"), *parse_signal("x:2"), *parse_signal("proximity:7,7")});
  EXPECT_EQ(texts(ball, plotted), (std::vector<std::string>{"x:5", "z:5"}));
  EXPECT_EQ(texts(cell, plotted), std::vector<std::string>{"proximity:1,2"});
}

struct PlotDataTest : testing::Test {
  PlotDataTest() : scene(4, 4) { scene.add_sphere(1.0, 1.0, 6.0, 1.0, {}); }
  // One more frame, in which the sphere is at x = the frame's number and moves at 5 u/s.
  void add_frame() {
    const auto number = static_cast<float>(history.end());
    scene.snapshot.time_s = 0.5 * number;
    scene.snapshot.position[0][0] = number;
    scene.snapshot.velocity[0] = {3.0f, 4.0f, 0.0f};
    history.frames.push_back(scene.snapshot);
  }
  TestScene scene;
  StoredFrames history;
  PlotData data;
  const Signal x{Kind::kObject, "x", 0, 0, 0}, speed{Kind::kObject, "speed", 0, 0, 0},
      gone{Kind::kObject, "x", 9, 0, 0}, frame{Kind::kMetric, "frame", 0, 0, 0};
};

TEST_F(PlotDataTest, SignalChosenLateHasTheStoredPast) {
  data.add(x);
  for (int i = 0; i < 4; ++i) add_frame();
  data.update(history);
  EXPECT_EQ(data.times(), (std::vector<double>{0.0, 0.5, 1.0, 1.5}));
  data.add(speed);
  data.add(gone);
  data.add(x);  // is there
  add_frame();
  data.update(history);
  ASSERT_EQ(data.series().size(), 3u);
  EXPECT_EQ(data.series()[0].values, (std::vector<double>{0, 1, 2, 3, 4}));
  EXPECT_EQ(data.series()[1].values, (std::vector<double>{5, 5, 5, 5, 5}));
  for (const double value : data.series()[2].values) EXPECT_TRUE(std::isnan(value));
}

TEST_F(PlotDataTest, FollowsDroppedAndRestartedHistories) {
  data.add(frame);
  for (int i = 0; i < 10; ++i) add_frame();
  data.update(history);
  history.frames.erase(history.frames.begin(), history.frames.begin() + 4);
  history.first = 4;
  add_frame();
  data.update(history);
  EXPECT_EQ(data.series()[0].values, (std::vector<double>{4, 5, 6, 7, 8, 9, 10}));
  EXPECT_EQ(data.times().front(), 2.0);
  history.first = 100;  // a jump past all that is known
  data.update(history);
  EXPECT_EQ(data.series()[0].values.front(), 100.0);
  EXPECT_EQ(data.times().size(), 7u);
  history.frames.resize(2);
  history.first = 0;
  data.update(history);
  EXPECT_EQ(data.series()[0].values, (std::vector<double>{0, 1}));
}

TEST_F(PlotDataTest, SetKeepsWhatStays) {
  data.set({x, speed});
  for (int i = 0; i < 3; ++i) add_frame();
  data.update(history);
  data.set({speed, frame});
  EXPECT_EQ(data.series()[0].values.size(), 3u);
  EXPECT_TRUE(data.series()[1].values.empty());
  data.update(history);
  EXPECT_EQ(data.series()[1].values, (std::vector<double>{0, 1, 2}));
  data.remove(speed);
  EXPECT_FALSE(data.contains(speed));
  EXPECT_TRUE(data.contains(frame));
}

TEST(PlotExport, TableNamesUnitsAndLeavesGapsEmpty) {
  EXPECT_EQ(to_csv({"a.csv", {0.0, 0.5}, {{"speed:3", "u/s", {1.25, NAN}}, {"height:1,2", "", {-2.0, 3.0}}}}),
            "time_s,speed:3 [u/s],\"height:1,2\"\n0,1.25,-2\n0.5,,3\n");
}

TEST(RoundUp, GivesOneTwoOrFive) {
  const std::pair<double, double> cases[] = {{1.0, 1.0}, {1.1, 2.0},   {2.0, 2.0},
                                             {3.0, 5.0}, {5.1, 10.0},  {0.1, 0.1},
                                             {0.3, 0.5}, {0.03, 0.05}, {700.0, 1000.0}};
  for (const auto& [value, round] : cases) EXPECT_NEAR(round_up(value), round, 1e-9 * round) << value;
  EXPECT_EQ(round_up(0.0), 1.0);
  EXPECT_EQ(round_up(NAN), 1.0);
  EXPECT_EQ(round_up(INFINITY), 1.0);
}

TEST(ReduceCurve, KeepsExtremesOfEachColumn) {
  std::vector<double> times, values;
  for (int i = 0; i < 10000; ++i) {
    times.push_back(0.001 * i);
    values.push_back(i == 4321 ? 7.0 : i == 6789 ? -3.0 : 0.0);
  }
  const std::vector<CurvePoint> points = reduce_curve(times, values, 0.0, 10.0, 100);
  EXPECT_LE(points.size(), 202u);
  double least = 0.0, most = 0.0, last_s = -1.0;
  for (const CurvePoint& point : points) {
    EXPECT_GE(point.time_s, last_s);
    last_s = point.time_s;
    least = std::min(least, point.value);
    most = std::max(most, point.value);
  }
  EXPECT_EQ(least, -3.0);
  EXPECT_EQ(most, 7.0);
}

TEST(ReduceCurve, ReachesTheEdgesAndBreaksAtGaps) {
  const std::vector<double> times = {0, 1, 2, 3, 4, 5}, values = {0, 10, 20, NAN, 40, 50};
  const std::vector<CurvePoint> points = reduce_curve(times, values, 1.5, 4.5, 1000);
  ASSERT_EQ(points.size(), 5u);
  EXPECT_EQ(points.front().time_s, 1.0);
  EXPECT_TRUE(std::isnan(points[2].value));
  EXPECT_EQ(points.back().value, 50.0);
}

TEST(PlotData, CurvesHaveColoursOfTheirOwn) {
  std::set<std::array<std::uint8_t, 3>> colours;
  for (std::size_t i = 0; i < 21; ++i) colours.insert(curve_colour(i));
  EXPECT_EQ(colours.size(), 21u);
}

}  // namespace
}  // namespace smartsurf::view
