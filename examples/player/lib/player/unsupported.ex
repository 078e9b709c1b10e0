defmodule Player.Unsupported do
  @moduledoc """
  Explains why a robot file leaves out some of Player's drivers and sections, and why there is no robot file of a
  configuration at all. Pure.
  """
  alias Hal.Options.Suggest
  alias Player.Sections

  @bases ~w(p2os p2os_position erratic roomba create khepera obot segwayrmp segwayrmp400 reb er1 nomad nomad_driver
            wbr914 epuck nxt mbasedriver roboteq clodbuster garcia hemisson robotino_driver motionmind
            rcore_xbridge differential)
  @simulators ~w(stage gazebo dummy)
  @logs ~w(readlog)

  @reasons [
    {@bases, "another base: Magellan Pro and ATRV mini are driven by rflex"},
    {@simulators ++ ~w(mapfile mapscale mapcspace vmapfile map_server),
     "robot files are of real robots; worlds and maps are the simulation's"},
    {~w(cameracompress camerauncompress imgsave), "pictures for viewers are made here on demand"},
    {~w(festival sphinx2 rtp), "speech is not supported"},
    {~w(vfh nd snd goto wavefront vec2map mbicp mricp globalize lasersafe bumper_safe deadstop velcmd),
     "robots navigate by their own means here"},
    {~w(amcl adaptive_mcl fakelocalize lasercspace ekfvloc mapping gridmap mrsp),
     "robots localise by odometry and each other"},
    {~w(sicklms200 sicklms400 sickpls sicks3000 sickLDMRS sicknav200 sickrfi341 urg urglaser hokuyo_aist hokuyoaist urg_nz
        rs4leuze pbs03jn), "another lidar: those of SLAMTEC and of TurtleBot3 are known"},
    {~w(laserbar laserbarcode laservisualbarcode laservisualbw lasertransform laserposeinterpolator
        rangerposeinterpolator laserrescan lasercutter laserfeature laserptzcloud fiducial),
     "nothing here is computed of a lidar's turns by Player's means"},
    {~w(canonvcc4 ptu46 amtecpowercube sonyevib20 amtecM5 sphereptz),
     "another head: only sonyevid30 is known"},
    {~w(camera1394 cameragst uvc camerareadlog imageseq kinect cvcam sphere libv4l2 unicapimage powershot),
     "give ffmpeg's name of that camera as the source of camera: instead"},
    {@logs ++
       ~w(writelog passthrough relay bumper2laser sonartoranger rangertolaser lasertoranger cmdsplitter
        kartowriter localbb inhibitor suppressor),
     "parts of Player communicate in other ways here"}
  ]
  @why for {names, why} <- @reasons, name <- names, into: %{}, do: {name, why}

  @doc """
  Why a driver is left out; `taken` are the names of those that are carried over.

      iex> Player.Unsupported.driver("festival", ["rflex", "camerav4l"])
      "speech is not supported"
      iex> Player.Unsupported.driver("camerav41", ["rflex", "camerav4l"])
      "none of our drivers does what it does; did you mean camerav4l?"
  """
  @spec driver(String.t() | nil, [String.t()]) :: String.t()
  def driver(nil, _taken), do: "has no name"

  def driver(name, taken) do
    Map.get_lazy(@why, name, fn ->
      "none of our drivers does what it does#{Suggest.hint(name, taken ++ Map.keys(@why))}"
    end)
  end

  @doc "Why a section is left out that is not a driver."
  @spec section(String.t()) :: String.t()
  def section("window"), do: "is a window of the simulator"
  def section("rule"), do: "rules name robots only in simulation"
  def section(_type), do: "is not a known driver"

  @doc """
  Why a file without a base that is known is of no robot, and the line that says so: of another base, of a simulator's robots, of a
  log, of a file that is not read, of devices alone.

      iex> {:ok, file} = Player.Sections.parse(~s|driver ( name "p2os" )|)
      iex> Player.Unsupported.robotless(file)
      {1, "no robot of ours is in it: its base has the driver p2os, and those of Magellan Pro and ATRV mini have rflex"}
      iex> {:ok, file} = Player.Sections.parse(~s|driver ( name "stage" worldfile "a.world" )|)
      iex> Player.Unsupported.robotless(file)
      {1, "no real robot is in it: stage simulates its devices; a Stage world is played by bin/demo --world"}
  """
  @spec robotless(Sections.file()) :: {pos_integer(), String.t()}
  def robotless(%{sections: sections, includes: includes}) do
    drivers = for section <- sections, name = Sections.driver(section), do: {section.line, name}
    first = fn known? -> Enum.find(drivers, fn {_line, name} -> known?.(name) end) end

    cond do
      base = first.(&(&1 in @bases)) ->
        {line, name} = base

        {line,
         "no robot of ours is in it: its base has the driver #{name}, and those of Magellan Pro and ATRV mini have rflex"}

      simulator = first.(&(&1 in @simulators or String.starts_with?(&1, "gz_"))) ->
        {line, name} = simulator
        world = if name == "stage", do: "; a Stage world is played by bin/demo --world"
        {line, "no real robot is in it: #{name} simulates its devices#{world}"}

      log = first.(&(&1 in @logs)) ->
        {elem(log, 0), "no robot is in it: it plays a log"}

      includes != [] ->
        {line, name} = hd(includes)
        {line, "no robot is in it without \"#{name}\": other files are not read, copy its text"}

      drivers != [] ->
        {line, _name} = hd(drivers)
        {line, "no robot is in it: none of its drivers is of a base (#{few(drivers)})"}

      true ->
        {1, "no robot is in it: it has no driver"}
    end
  end

  defp few(drivers) do
    names = drivers |> Enum.map(&elem(&1, 1)) |> Enum.uniq()
    {shown, more} = Enum.split(names, 5)
    Enum.join(shown, ", ") <> if(more == [], do: "", else: " and #{length(more)} more")
  end
end
