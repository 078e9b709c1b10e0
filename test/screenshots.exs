# Makes the pictures of the page for README and guide, in a real browser: docs/images/page*.png.
#
#   MIX_ENV=test mix run --no-start test/screenshots.exs [FOLDER]
#
# With a folder, all sizes and colours go there, to look at.
#
# Six robots in the hospital, by processes and so in real time: no two pictures are the same to the byte.
alias Console.{Browser, Live, Options, Page}

Logger.configure(level: :none)
why_not = Browser.why_not()
if why_not, do: Mix.raise("no pictures: " <> why_not)

{:ok, options} = Options.parse(~w(--robots 6 --seed 7 --map hospital --plan known))
{:ok, live} = Live.Fleet.start_link(Options.trial(options))
{:ok, _page, url} = Page.start_link(module: Live.Fleet, live: live, robots: options.robots)

dark = ["--force-dark-mode", "--blink-settings=preferredColorScheme=0"]

pictures = [{"page", {1280, 860}, []}, {"page-dark-phone", {390, 844}, dark}]

all =
  for {size, pixels} <- [wide: {1280, 720}, phone: {390, 844}],
      {shade, flags} <- [light: [], dark: dark],
      do: {"#{size}-#{shade}", pixels, flags}

{folder, pictures} =
  case System.argv() do
    [] -> {"docs/images", pictures}
    [folder] -> {folder, all}
  end

for {name, size, flags} <- pictures do
  browser = Browser.open(size, flags)
  Browser.go(browser, url)
  Browser.await(browser, "return window.floor.scene?.robots.filter((r) => r.slot).length >= 4")

  choose =
    "document.querySelectorAll('#robots button')[4].click(); document.getElementById('sonar').click()"

  Browser.run(browser, choose)
  Browser.await(browser, "return window.floor.about?.camera")
  Browser.run(browser, "document.getElementById('camera').click()")

  Browser.await(
    browser,
    "return document.getElementById('picture').height > 0 && window.floor.about.seen"
  )

  Browser.await(
    browser,
    "return new Promise((go) => setTimeout(() => go(true), 1500))"
  )

  File.write!(Path.join(folder, name <> ".png"), Browser.picture(browser))
  [] = Browser.errors(browser)
  Browser.close(browser)
  IO.puts(Path.join(folder, name <> ".png"))
end

Live.Fleet.stop(live)
