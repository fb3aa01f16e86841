#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>

#include "fly/report/html_report.h"
#include "fly/report/map_plot.h"
#include "fly/report/plot.h"
#include "fly/report/requirement.h"
#include "fly/report/summary.h"

namespace terrace::fly {
namespace {

FlightOptions SomeOptions() {
  FlightOptions options;
  options.document = *ParseUrl("http://127.0.0.1:1/<maui>/layer.json");
  options.path = MakeStraightPath({7, 46, 3000}, {8, 46, 3000}, {});
  return options;
}

// Three seconds: ten tiles, one of them late, a refusal, and a frame in ten with a hole.
void Fill(Statistics& statistics) {
  ClientRecord client;
  client.document_s = 0.1;
  client.first_view_s = 1.5;
  client.arrival_s = 0;
  statistics.SetClient(0, client);
  for (int i = 0; i < 10; ++i) {
    RequestRecord tile;
    tile.seconds = i == 9 ? 0.9 : 0.01;
    tile.bytes = 1000;
    tile.triangles = 50;
    tile.tier = i < 4 ? CacheTier::kHit : CacheTier::kMiss;
    statistics.AddRequest(i * 0.3, tile);
    statistics.AddLoadedTile({10, 1060 + i, 770});
    FrameRecord frame;
    frame.is_refined = i != 3;
    frame.coverage = Coverage{.rays = 100, .missing = i == 5 ? 7 : 0};
    frame.worst_px = 10 + i;
    frame.drawn = 1;
    frame.sees_data = true;
    statistics.AddFrame(i * 0.3, frame);
    statistics.AddCamera({7 + i * 0.01, 46, 3000});
  }
  RequestRecord refused;
  refused.outcome = Outcome::kRefused;
  statistics.AddRequest(1, refused);
}

TEST(Summary, TheWorstArrivalIsThatOfAllClients) {
  const auto arrival_of = [](const std::vector<double>& arrivals_s) {
    Statistics statistics(static_cast<int>(arrivals_s.size()) + 1);  // the last one does not open the document
    for (std::size_t i = 0; i < arrivals_s.size(); ++i) {
      ClientRecord client;
      client.document_s = 0.1;
      client.arrival_s = arrivals_s[i];
      statistics.SetClient(static_cast<int>(i), client);
    }
    return Summarize(SomeOptions(), statistics.record()).arrival_s;
  };
  EXPECT_EQ(arrival_of({0.5, 2}), 2);
  EXPECT_EQ(arrival_of({0.5, -1}), -1);
}

TEST(Summary, AClientWithoutAFullViewIsTheSlowest) {
  const auto views_of = [](const std::vector<double>& views_s) {
    Statistics statistics(static_cast<int>(views_s.size()));
    for (std::size_t i = 0; i < views_s.size(); ++i) {
      ClientRecord client;
      client.document_s = views_s[i] == -2 ? -1 : 0.1;
      client.first_view_s = std::max(-1.0, views_s[i]);
      statistics.SetClient(static_cast<int>(i), client);
    }
    const Summary summary = Summarize(SomeOptions(), statistics.record());
    return std::pair(summary.first_view_s, summary.worst_first_view_s);
  };
  EXPECT_EQ(views_of({2, 0.5, 1}), std::pair(1.0, 2.0));
  EXPECT_EQ(views_of({0.5, -1, 1}), std::pair(1.0, -1.0));
  EXPECT_EQ(views_of({-2, 0.5, 1}), std::pair(1.0, -1.0));  // -2: no document
  EXPECT_EQ(views_of({-1, 0.5, -1}), std::pair(-1.0, -1.0));
}

TEST(Summary, ReportsAgreeThatAClientNeverHadAFullView) {
  Statistics statistics(3);
  Fill(statistics);
  ClientRecord client;
  client.document_s = client.first_view_s = 1.5;
  statistics.SetClient(1, client);
  const FlightOptions options = SomeOptions();
  const Summary summary = Summarize(options, statistics.record());
  const std::string json = JsonOf(options, summary, {}, {}), text = TextOf(summary),
                    html = HtmlOf(options, summary, {}, statistics.record());
  EXPECT_NE(json.find(R"("worst": null)"), std::string::npos) << json;
  EXPECT_NE(json.find(R"("median": 1.5)"), std::string::npos) << json;
  EXPECT_NE(text.find("1500 ms median, never worst of 3 clients"), std::string::npos) << text;
  EXPECT_NE(html.find(R"(<b class="bad">never</b><span>until the first full view, slowest client)"), std::string::npos);
}

TEST(Summary, CountsWhatHappened) {
  Statistics statistics(1);
  Fill(statistics);
  const Summary summary = Summarize(SomeOptions(), statistics.record());
  EXPECT_EQ(summary.totals.tiles, 10U);
  EXPECT_EQ(summary.totals.bytes, 10'000U);
  EXPECT_NEAR(summary.p50_s, 0.01, 1e-5);
  EXPECT_NEAR(summary.p99_s, 0.9, 1e-6);
  EXPECT_NEAR(summary.refined_share, 0.9, 1e-9);
  EXPECT_EQ(summary.totals.hole_frames, 1U);
  EXPECT_NEAR(summary.totals.worst_hole, 0.07, 1e-9);
  EXPECT_EQ(summary.errors, 0U);
  EXPECT_NEAR(summary.worst_first_view_s, 1.5, 1e-6);
  const std::string text = TextOf(summary);
  EXPECT_NE(text.find("Holes: 1 of 10"), std::string::npos) << text;
  EXPECT_NE(text.find("refused (429, 503)"), std::string::npos) << text;
  EXPECT_NE(LineOf(1, statistics.second(1)).find("refused or failed 1"), std::string::npos);
}

// Tiles that failed are no reason to add cores.
TEST(Summary, AServerDoesNotKeepUpIfFramesWaitForTiles) {
  for (const int waiting : {25, 26}) {
    Statistics statistics(1);
    for (int i = 0; i < 100; ++i) {
      FrameRecord frame;  // not refined
      frame.is_waiting = i < waiting;
      statistics.AddFrame(0.01 * i, frame);
    }
    const std::string text = TextOf(Summarize(SomeOptions(), statistics.record()));
    EXPECT_EQ(text.find("The server does not keep up: 26 % of the frames of the flight waited for tiles.") !=
                  std::string::npos,
              waiting > 25)
        << text;
    EXPECT_EQ(text.find("keep up") != std::string::npos, waiting > 25) << text;
  }
}

// A server that dies is not a fast one.
TEST(Requirements, CountTheSecondsInWhichNoTileArrivedThoughSomeWereWanted) {
  Statistics statistics(1);
  for (int i = 0; i < 12; ++i) statistics.AddRequest(0.5, {});
  for (const double now_s : {1.5, 2.5}) {
    FrameRecord waiting;
    waiting.wanted = 5;
    statistics.AddFrame(now_s, waiting);
  }
  FrameRecord asking;
  asking.in_flight = 3;
  statistics.AddFrame(3.5, asking);
  statistics.AddFrame(4.5, {});  // nothing to load
  const Summary summary = Summarize(SomeOptions(), statistics.record());
  EXPECT_EQ(summary.tiles_per_second, 3);
  EXPECT_TRUE(Judge(*ParseRequirements("tiles=3"), summary).AllHold());
  EXPECT_FALSE(Judge(*ParseRequirements("tiles=3.1"), summary).AllHold());
}

// Slow tiles are not left out because the flight is shorter, and failed ones not because they never arrive.
TEST(Requirements, CountTilesThatDidNotArriveAmongTheLatencies) {
  const auto judge = [](int failed, const std::vector<double>& waited_s, const char* requirements) {
    Statistics statistics(1);
    RequestRecord tile;
    tile.seconds = 0.01;
    for (int i = 0; i < 80; ++i) statistics.AddRequest(0.5, tile);
    for (int i = 0; i < failed; ++i) statistics.AddFailedTile();
    for (const double waited : waited_s) statistics.AddOpenTile(waited);
    const Summary summary = Summarize(SomeOptions(), statistics.record());
    return std::pair(Judge(*ParseRequirements(requirements), summary).AllHold(), TextOf(summary));
  };
  const std::vector<double> young(20, 0.001), old(20, 4.0), most_old(81, 4.0);
  EXPECT_TRUE(judge(0, {}, "p50=11ms,p99=11ms").first);
  EXPECT_TRUE(judge(0, young, "p50=11ms,p99=11ms").first) << "open requests at the end are normal";
  EXPECT_FALSE(judge(0, young, "p50=9ms").first) << "and make the others no faster";
  EXPECT_EQ(judge(0, young, "").second.find("had not arrived at the end; one"), std::string::npos);
  EXPECT_TRUE(judge(0, old, "p50=11ms,p99=4s,errors=0").first);
  EXPECT_FALSE(judge(0, old, "p99=3900ms").first);
  EXPECT_NE(judge(0, old, "").second.find("20 tiles had not arrived at the end; one was awaited for 4000 ms"),
            std::string::npos);
  EXPECT_FALSE(judge(0, most_old, "p50=3900ms").first);
  EXPECT_TRUE(judge(2, {}, "p50=11ms").first);
  EXPECT_FALSE(judge(2, {}, "p99=9999s").first) << "2 of 82 never arrive";
  EXPECT_NE(judge(2, {}, "").second.find("p99 never"), std::string::npos);
}

TEST(Requirements, DoNotHoldWhereNoTerrainWasSeen) {
  Statistics statistics(1);
  statistics.AddRequest(0, {});
  FrameRecord frame;
  frame.coverage = Coverage();
  frame.worst_px = 9999;  // of tiles without a mesh
  statistics.AddFrame(0, frame);
  const FlightOptions options = SomeOptions();
  const Summary nothing = Summarize(options, statistics.record());
  for (const char* text : {"holes=0", "screen-error=9px"}) {
    const Judgements judgements = Judge(*ParseRequirements(text), nothing);
    EXPECT_FALSE(judgements.AllHold()) << text;
    EXPECT_EQ(judgements.all[0].shown, "not measured");
  }
  EXPECT_TRUE(nothing.is_beside_data);
  EXPECT_NE(TextOf(nothing).find("no terrain of the dataset"), std::string::npos);
  for (const char* null : {R"("p99": null)", R"("max": null)", R"("stated_max": null)"}) {
    EXPECT_NE(JsonOf(options, nothing, {}, {}).find(null), std::string::npos) << null;
  }
  EXPECT_EQ(HtmlOf(options, nothing, {}, statistics.record()).find("-1.0 px"), std::string::npos);
  frame.sees_data = true;
  statistics.AddFrame(0, frame);
  EXPECT_FALSE(Summarize(options, statistics.record()).is_beside_data);
}

TEST(Requirements, HoldOrFail) {
  Statistics statistics(1);
  Fill(statistics);
  const Summary summary = Summarize(SomeOptions(), statistics.record());
  const auto holds = [&summary](std::string_view text) {
    const auto requirements = ParseRequirements(text);
    EXPECT_TRUE(requirements) << text;
    return Judge(*requirements, summary).AllHold();
  };
  EXPECT_TRUE(holds(""));
  EXPECT_TRUE(holds("full-view=2s,p50=20ms,p99=1s,refined=90%,screen-error=20px,holes=1,errors=0,refusals=1,hits=40%"));
  for (const char* text : {"full-view=1s", "p50=5ms", "p99=899ms", "refined=91%", "screen-error=18", "holes=0",
                           "refusals=0", "hits=41%", "tiles=11"}) {
    EXPECT_FALSE(holds(text)) << text;
  }
  Statistics nothing(1);
  const Summary empty = Summarize(SomeOptions(), nothing.record());
  for (const char* text : {"full-view=99s", "p99=99s", "refined=0%", "holes=9", "hits=0%", "tiles=0"}) {
    EXPECT_FALSE(Judge(*ParseRequirements(text), empty).AllHold()) << text;  // what was not measured does not hold
  }
}

TEST(Requirements, ShowWhyTheyFail) {
  const auto shown = [](std::string_view text, const Summary& summary) {
    return Judge(*ParseRequirements(text), summary).all[0].shown;
  };
  Summary summary;
  summary.totals.tiles = summary.totals.flying_frames = 1;
  summary.tiles_per_second = 29.7;
  summary.p99_s = 0.05004;
  summary.refined_share = 0.949996;
  EXPECT_EQ(shown("tiles=30", summary), "29.7");
  EXPECT_EQ(shown("tiles=29", summary), "30");
  EXPECT_EQ(shown("p99=50ms", summary), "50.04 ms");
  EXPECT_EQ(shown("p99=60ms", summary), "50.0 ms");
  EXPECT_EQ(shown("refined=95%", summary), "94.9996 %");
  EXPECT_EQ(shown("errors=0", summary), "0");
  summary.p99_s = 1.0004;
  EXPECT_EQ(shown("p99=1s", summary), "1.0004 s");
}

TEST(Requirements, NameThePartThatIsWrong) {
  for (const char* text :
       {"p98=2s", "p99", "p99=2", "p99=2px", "refined=95", "holes=-1", "p99=1e999s", "full-view=2s,,p50=1s"}) {
    const auto requirements = ParseRequirements(text);
    ASSERT_FALSE(requirements) << text;
    EXPECT_NE(requirements.error().message.find("full-view=2s"), std::string::npos);
  }
}

TEST(JsonReport, KeepsThePrecisionOfShortLatencies) {
  Statistics statistics(1);
  RequestRecord tile;
  tile.seconds = 0.00034375;
  statistics.AddRequest(0.5, tile);
  const FlightRecord record = statistics.record();
  const std::string json = JsonOf(SomeOptions(), Summarize(SomeOptions(), record), {}, record.seconds);
  EXPECT_NE(json.find(R"("max": 0.00034375)"), std::string::npos) << json;
  EXPECT_NE(json.find(R"("p50_s": 0.00034375)"), std::string::npos) << json;
}

TEST(HtmlReport, StandsAlone) {
  Statistics statistics(1);
  Fill(statistics);
  statistics.AddMessage("<script>alert(1)</script>");
  const FlightOptions options = SomeOptions();
  const Summary summary = Summarize(options, statistics.record());
  const std::string html = HtmlOf(options, summary, Judge(*ParseRequirements("p99=1ms"), summary), statistics.record());
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("src="), std::string::npos);
  EXPECT_EQ(html.find("<link"), std::string::npos);
  EXPECT_EQ(html.find("nan"), std::string::npos);
  EXPECT_NE(html.find("&lt;maui&gt;"), std::string::npos);
  EXPECT_NE(html.find("Requirements failed"), std::string::npos);
  EXPECT_NE(html.find("class=\"map\""), std::string::npos);
}

TEST(HtmlReport, ShowsAFlightWithoutAnything) {
  Statistics statistics(1);
  const FlightOptions options = SomeOptions();
  const std::string html = HtmlOf(options, Summarize(options, statistics.record()), {}, statistics.record());
  EXPECT_NE(html.find("never"), std::string::npos);
  EXPECT_EQ(html.find("inf"), std::string::npos);
}

TEST(CacheTierOfClient, IsReadFromServerTiming) {
  EXPECT_EQ(ParseCacheTier("cache;desc=hit"), CacheTier::kHit);
  EXPECT_EQ(ParseCacheTier("cache;desc=miss, queue;dur=0.06"), CacheTier::kMiss);
  EXPECT_EQ(ParseCacheTier("cache;desc=disk"), CacheTier::kLower);
  EXPECT_EQ(ParseCacheTier("cache;desc=join, x"), CacheTier::kJoin);
  EXPECT_EQ(ParseCacheTier("cdn-cache; desc=HIT"), CacheTier::kUnknown);
}

}  // namespace
}  // namespace terrace::fly
