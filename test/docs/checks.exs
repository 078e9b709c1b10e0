defmodule Docs.Checks do
  @moduledoc """
  What is wrong with a document. A command that needs what is not here, or takes long, is listed here with the reason;
  of such a one only words and options are compared with what its program knows. A new line is thus run unless somebody
  says why not.
  """
  alias Docs.{LookedAt, Reader, Sandbox}

  @example "test/example_test.exs builds and runs it"
  @live "it goes on until somebody ends it"
  @tests "it is the tests"
  @long "it takes longer than 10 s"
  @robot "it needs a robot"
  @release "it needs a release, which test/release_test.exs builds, and runs"
  @device "it needs a camera"
  @sources "it needs the sources of packages"
  @drawing "it needs a drawing of others"
  @ssh "it needs another machine"
  @system "it changes this system"
  @node "its iex> lines run in such a node"

  # Commands that are not run, and why not.
  @not_run %{
    "bin/demo" => @live,
    "bin/test" => @tests,
    "bin/test-on bookworm --fresh" => @tests,
    "bin/test-on trixie --fresh" => @tests,
    "bin/setup" => @system,
    "mix scenario examples/course/tour.exs" =>
      "it needs a solution, which test/course_test.exs brings",
    "cp -r examples/gather ../ours" => @example,
    "cd ../ours && export CONVOY=../convoy && mix demo --mission gather --landmark none" =>
      @example,
    "bin/soak 46 1" => @long,
    "bin/demo --foxglove" => @live,
    "bin/demo --rmf" => @live,
    "bin/demo --incidents incidents" => @live,
    "bin/console --rmf" => @live,
    "bin/console --foxglove" => @live,
    "bin/demo --rosbridge" => @live,
    "bin/console --rosbridge" => @live,
    "bin/demo --nodes" => @live,
    "bin/demo --nodes --robots 4" => @live,
    "bin/demo --map floor.png:16x12 --landmark 2,1" => @live,
    "bin/demo --map building.yaml" => @live,
    "bin/demo --world examples/stage/yard.world" => @live,
    "bin/demo --headless --map hospital.png:110x42 --robots 5" => @drawing,
    "bin/console --page-address 0.0.0.0 --page-token-file page.token" => @live,
    "bin/demo --hardware 1" => @live,
    "mix demo --record live.mcap" => @live,
    "mix demo --headless --hardware 2 --record live.mcap" => @long,
    "bin/demo --hardware mag:1,min:1" => @live,
    "bin/console --connect mag1@convoy" => @live,
    "bin/node mag1" => @node,
    "bin/node mag2" => @node,
    "mix demo --headless --hardware mag:1,min:1 --seed 1" => @long,
    "mix bench demo --seeds 1-10 --maps hall --cases six,move,kill-leader" => @long,
    "mix bench demo --seeds 1-40 --maps hall,hospital --markdown table.md" => @long,
    "mix bench demo --seeds 1-40 --maps hall --cases six,exact,move,kill-leader,kill-middle,loss,slip,one,two,three,twelve" =>
      @long,
    "mix bench demo --seeds 1-20 --maps hall --cases slip,same,chain,twelve-chain,line,wedge,triangle,diamond,circle" =>
      @long,
    "mix chaos" => @long,
    "mix chaos --runs 1000 --keep failures" => @long,
    "mix bench swarm --nodes 3,10 --robots-in-one-node 100" => @long,
    "mix bench swarm --nodes 30 --robots-in-one-node 0" => @long,
    "mix bench vision --beside CMVision" => "it needs a program of others",
    "mix blobs /dev/video0 --colours config/robots/landmark.txt --picture out.png" => @device,
    "mix calibrate colour /dev/video0 --box 140,90,40,60 --name YellowLandmark --picture look.png" =>
      @device,
    "mix calibrate colour /dev/video0 --box 140,90,40,60 --name YellowLandmark --colours config/robots/landmark.txt" =>
      @device,
    "mix calibrate odometry config/robots/mag1.exs" => @robot,
    "mix calibrate ranges config/robots/mag1.exs --at 0.5,1,2" => @robot,
    "mix calibrate ranges config/robots/mag1.exs --sensor infrared --at 0.2,0.4,0.6" => @robot,
    "MIX_ENV=prod mix release robot" => @release,
    "bin/emulate rflex --link /tmp/base" => @live,
    "ROBOT=try1 CONVOY_ROBOT_FILE=examples/emulated/try1.exs bin/robot daemon" => @release,
    "ROBOT=try1 bin/robot rpc 'Swarm.arm(:try1)'" => @release,
    "ROBOT=try1 bin/robot rpc 'Swarm.tell(:try1, \"move:0.2:0\")'" => @release,
    "kill -9 $(ROBOT=try1 bin/robot pid)" => @release,
    "MIX_ENV=prod mix release fleet" => @release,
    "MIX_TARGET=robot mix deps.get" => "it needs Hex",
    "MIX_TARGET=robot MIX_ENV=prod mix release robot" => "it needs Hex",
    "CONVOY_DEPS=../deps MIX_TARGET=robot MIX_ENV=prod mix release robot" => @sources,
    "bin/adapters ../deps" => @sources,
    "ROBOT=base CONVOY_SECRET_FILE=$PWD/convoy.secret _build/prod/rel/fleet/bin/fleet start_iex" =>
      @release,
    "ROBOT=mag1 bin/robot check" => @release,
    "ROBOT=mag1 CONVOY_ROBOT_FILE=config/robots/mag1.exs bin/robot daemon" => @release,
    "ROBOT=mag1 CONVOY_ROBOT_FILE=config/robots/mag1.exs bin/robot rpc 'Swarm.arm(:mag1)'" =>
      @release,
    "ROBOT=mag1 bin/robot start" => @release,
    "ROBOT=mag1 bin/robot rpc 'Swarm.status()'" => @release,
    "ROBOT=mag1 bin/robot remote" => @release,
    "rel/deploy root@10.0.0.11 mag1" => @ssh,
    "rel/deploy --dry-run root@10.0.0.11 mag2" => @release,
    "rel/deploy root@10.0.0.11 mag2" => @ssh,
    "rel/deploy --back root@10.0.0.11" => @ssh,
    "rel/deploy --release _build/robot_prod/rel/robot root@10.0.0.11 mag1" => @ssh,
    "ssh -t root@10.0.0.11 robot remote" => @ssh,
    "scp -p convoy.secret root@mag1:/etc/convoy/secret" => @ssh,
    "scp -pr certs/mag1 root@mag1:/etc/convoy/certs/" => @ssh,
    "apt-get install --no-install-recommends openssh-server ffmpeg" => @system,
    "(umask 077; mkdir -p /etc/convoy; head -c 32 /dev/urandom | base64 > /etc/convoy/secret)" =>
      @system,
    "nft add rule inet filter input ip saddr != 10.0.0.0/24 tcp dport 9101-9303 drop" => @system,
    "nft add rule inet filter input ip saddr != 10.0.0.0/24 udp dport 4370-4371 drop" => @system,
    "erl … -proto_dist Elixir.Mesh.Distribution.Tls -ssl_dist_optfile certs/mag1/ssl_dist.conf" =>
      "it is a part of a command; apps/mesh/test/mesh/distribution/connection_log_test.exs runs such nodes",
    ~S(iex --sname rem-1@lab --hidden --cookie "$COOKIE" --remsh mag1@lab --erl "-start_epmd false -kernel net_ticktime 8 -epmd_module Elixir.Mesh.Distribution.Epmd -pa _build/dev/lib/hal/ebin _build/dev/lib/mesh/ebin") =>
      @robot
  }

  # And what others need.
  @programs [{"mix fleet.certs", "openssl"}]

  # How blocks begin that nobody types.
  @shown [
    "eval \"$(bin/livebook)\" && livebook server",
    "config/robots/rex.exs:3: profile: config/bodies/rover.exs:8",
    "network: [fleet: [\"mag1\"",
    "52.3 s replayed: all 11665 decisions on",
    "live.mcap: 2 live robots",
    "wishes, the strongest first:",
    "   40.0 s  FAILED  {:formed, by_s: 40}",
    "tools -> console -> lab -> record",
    "tools --> console --> lab --> record",
    "Swarm.Supervisor (rest_for_one",
    "idle -> search -> agree",
    "Comms --Transport",
    "camera          Hal.Device      BlobDetector",
    "caller             Comms of mag1",
    "caller                EStop of each robot",
    # One line of a status.
    "#min1 follow (1.20",
    "#mag1 follow (-4.69",
    "{:error, \"mag1 cannot go to",
    # Flags and settings.
    "-kernel prevent_overlapping_partitions",
    "config :swarm, mesh: [multicast",
    "config :swarm, mesh: [topologies",
    "config :swarm, companions: [{Agents.Programs",
    "-pa _build/dev/lib/hal/ebin _build/dev/lib/mesh/ebin",
    # Programs in Python; apps/bridge tries them where roslibpy is.
    "pip install roslibpy",
    # Programs of users of Player; examples/player tests the server, which is built along by hand.
    "ln -s ../examples/player apps/player",
    "#include <libplayerc/playerc.h>",
    "from playerc import *",
    # What programs print that are not run here.
    "Active: active (running)",
    "27.6 s  wheels 0.20 m/s",
    "Now 3.00 m straight ahead.",
    "distance     1.0240",
    "sample   784 pixels",
    "Assumed; check whether",
    "config/robots/mag1.exs:7: limits.max_liner",
    "config/robots/mag1.exs:9: map: /home",
    "refused mag3 at",
    "import Config",
    "fleet_manager:",
    "scrape_configs:",
    "curl http://127.0.0.1:40123/metrics",
    "mag1  pid 3308",
    "mag1 has real drivers",
    # Files.
    "map: \"building.yaml\",",
    "image: building.png ",
    "marks:                    # in building.yaml",
    "#!/bin/sh",
    "defmodule Lab.FleetFeed do",
    "defmodule LabWeb.FleetLive do",
    "[Colors]"
  ]

  @doc "The commands that are not run, as they are typed."
  @spec not_run() :: [String.t()]
  def not_run, do: Map.keys(@not_run)

  @doc "How the blocks begin that are only shown."
  @spec shown() :: [String.t()]
  def shown, do: @shown

  @doc "A command as it is typed, without the remark."
  @spec command(String.t()) :: String.t()
  def command(text) do
    text
    |> String.replace(~r/\\\n\s*/, "")
    |> String.replace(~r/\s+# .*$/, "")
  end

  @doc "Blocks that look as if somebody typed them, and nobody knows whether."
  @spec unknown([Reader.item()]) :: [String.t()]
  def unknown(items) do
    for {kind, n, text, answer} <- items, strange?(kind, text, answer) do
      "line #{n}: #{text}: is this typed? Docs.Reader does not see it; what is only shown is listed in test/docs/checks.exs"
    end
  end

  defp strange?(:shown, text, _answer), do: not Enum.any?(@shown, &String.starts_with?(text, &1))
  defp strange?(:shell, text, answer), do: answer != "" and is_map_key(@not_run, command(text))
  defp strange?(_kind, _text, _answer), do: false

  @doc "What is wrong with the commands, which are typed in the folder unless they are listed above."
  @spec commands([Reader.item()], Path.t()) :: [String.t()]
  def commands(items, folder) do
    items
    |> Enum.filter(fn {kind, _n, _text, _answer} -> kind in [:shell, :prompt, :file] end)
    |> Enum.chunk_by(&(elem(&1, 0) == :shell))
    |> Enum.flat_map(&all(&1, folder))
    |> Enum.reject(fn {_item, wrong} -> wrong == nil end)
    |> Enum.map(fn {{_kind, n, text, _answer}, wrong} -> "line #{n}: #{text}: #{wrong}" end)
  end

  @doc "What is wrong with words and options of the commands that are not run."
  @spec looked_at([Reader.item()], Path.t()) :: [String.t()]
  def looked_at(items, folder) do
    for {:shell, n, text, _answer} <- items,
        not run?(text),
        wrong = LookedAt.command(Reader.words(text), folder),
        do: "line #{n}: #{text}: #{wrong}"
  end

  defp all([{:shell, _n, _text, _answer} | _] = items, folder) do
    {run, looked_at} = Enum.split_with(items, fn {_kind, _n, text, _answer} -> run?(text) end)
    lines = for {:shell, _n, text, answer} <- run, do: {text, answer}

    looked_at =
      for {_kind, _n, text, _answer} = item <- looked_at,
          do: {item, LookedAt.command(Reader.words(text), folder)}

    Enum.sort_by(Enum.zip(run, Sandbox.run(lines, folder)) ++ looked_at, &elem(elem(&1, 0), 1))
  end

  defp all(items, folder), do: for(item <- items, do: {item, wrong(item, folder)})

  defp wrong({:prompt, _n, text, _answer}, _folder), do: LookedAt.prompt(text)
  defp wrong({:file, _n, path, text}, folder), do: Sandbox.write(path, text, folder)

  defp run?(text), do: not is_map_key(@not_run, command(text)) and lacking(text) == nil

  # Programs that a machine may do without (bin/setup).
  defp lacking(text) do
    with {_command, program} <- Enum.find(@programs, &String.starts_with?(text, elem(&1, 0))),
         nil <- System.find_executable(program) do
      IO.puts("not run, as #{program} is not here: #{text}")
      program
    else
      _there_or_not_needed -> nil
    end
  end

  @doc "A sentence may say anything; but a command or a function that it names must be there."
  @spec mentions([Reader.item()], Path.t()) :: [String.t()]
  def mentions(items, folder) do
    for {:mention, n, text, _answer} <- items,
        wrong = LookedAt.mention(text, folder),
        do: "line #{n}: #{text}: #{wrong}"
  end
end
