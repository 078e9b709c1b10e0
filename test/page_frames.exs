# Measures the frames of the page with a hundred robots, in a real browser: what the scripts of a scene and of drawing take,
# and how often the browser draws.
#
#   MIX_ENV=test mix run --no-start test/page_frames.exs [SECONDS]
#
# The robots go in lockstep, so that the browser does not wait for them: the first half a minute at real time or slower,
# which makes trails; then they are paused, and only the page works.
alias Console.{Browser, Live, Options, Page}

Logger.configure(level: :none)
why_not = Browser.why_not()
if why_not, do: Mix.raise("no figures: " <> why_not)
seconds = System.argv() |> List.first("20") |> String.to_integer()

{:ok, options} = Options.parse(~w(--robots 100 --seed 3 --blobs direct --formation circle))
{:ok, live} = Live.Trial.start_link(Lab.Trial, Options.trial(options), Console.Pace.new(1.0))
{:ok, _page, url} = Page.start_link(module: Live.Trial, live: live, robots: options.robots)
browser = Browser.open({1280, 800})
Browser.go(browser, url)
Browser.await(browser, "return document.querySelectorAll('#robots tr').length === 100", 1_200)
Browser.run(browser, "document.querySelector('#robots button').click()")

# A frame is asked for at once after each, beside those of the page's own.
Browser.run(browser, """
const f = window.floor, m = window.measured = { scene: [], paint: [], between: [] };
const timed = (what, work) => function (...given) {
  const begun = performance.now();
  work.apply(this, given);
  m[what].push(performance.now() - begun);
};
f.paint = timed("paint", f.paint);
f.setScene = timed("scene", f.setScene);
let last;
const frame = (at) => {
  if (last) m.between.push(at - last);
  last = at;
  requestAnimationFrame(frame);
};
requestAnimationFrame(frame);
""")

figures = fn title ->
  Browser.run(browser, "for (const list of Object.values(window.measured)) list.length = 0;")

  receive do
  after
    seconds * 1_000 -> :ok
  end

  for {what, says} <- [scene: "taking a scene", paint: "drawing", between: "from frame to frame"] do
    [count, median, most, longest] =
      Browser.run(browser, """
      const all = [...window.measured.#{what}].sort((a, b) => a - b), n = all.length;
      return [n, ...[0.5, 0.95, 1].map((share) => all[Math.ceil(share * n) - 1])];
      """)

    shown =
      Enum.map_join([median, most, longest], " / ", &Console.Cli.Format.decimals(&1 * 1.0, 1))

    IO.puts("#{title}, #{says}: median / 95 % / longest #{shown} ms, of #{count}")
  end
end

Browser.await(browser, "return window.floor.scene.at_s > 20", 3_000)
figures.("100 robots drive")
{:ok, _paused} = Live.Trial.command(live, {:pace, :pause})
figures.("100 robots, paused")
Browser.close(browser)
