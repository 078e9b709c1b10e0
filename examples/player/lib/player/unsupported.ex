defmodule Player.Unsupported do
  @moduledoc "Explains why a robot file leaves out some of Player's drivers and sections. Pure."
  alias Hal.Options.Suggest

  @reasons [
    {~w(cameracompress camerauncompress), "pictures for viewers are made here on demand"},
    {~w(festival sphinx2 rtp), "speech is not supported"},
    {~w(stage gazebo mapfile mapscale mapcspace map_server),
     "robot files are of real robots; worlds and maps are the simulation's"},
    {~w(vfh nd snd goto wavefront mbasedriver roboteq vec2map),
     "robots navigate by their own means here"},
    {~w(amcl lasercspace ekfvloc mapping mrsp), "robots localise by odometry and each other"},
    {~w(sicklms200 sicklms400 sickpls sicks3000 urg urglaser hokuyo_aist urg_nz rs4leuze laserposeinterpolator),
     "lasers are not supported"},
    {~w(laserbar laserbarcode laservisualbarcode laservisualbw lasertransform fiducial),
     "lasers are not supported"},
    {~w(p2os erratic roomba khepera obot segwayrmp reb er1 nomad wbr914 epuck),
     "another base: Magellan Pro and ATRV mini are driven by rflex"},
    {~w(canonvcc4 ptu46 amtecpowercube sonyevib20 amtecM5),
     "another head: only sonyevid30 is known"},
    {~w(camera1394 cameragst uvc camerareadlog imageseq kinect),
     "give ffmpeg's name of that camera as the source of camera: instead"},
    {~w(writelog readlog passthrough relay bumper2laser sonartoranger rangertolaser lasertoranger cmdsplitter kartowriter),
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
end
