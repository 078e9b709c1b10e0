defmodule Robot.File.CrossChecks do
  @moduledoc "Checks of a robot file that involve several keys. Pure."
  alias Hal.Options.Suggest
  alias Robot.File.{Device, Schema}

  @doc "All problems, each as the path of its key and a text; `file` is the robot file's path."
  @spec problems(Robot.File.t(), Path.t()) :: [{[String.t(), ...], String.t()}]
  def problems(robot, file) do
    Enum.reject(
      [
        named(robot, file),
        seen(robot),
        kept(robot),
        placed(robot),
        shared(robot),
        colour(robot) | limits(robot) ++ driven(robot)
      ],
      &(&1 == nil)
    )
  end

  # If a file is copied for another robot and its id is not changed, two robots have the same
  # name.
  defp named(robot, file) do
    name = Path.basename(file, ".exs")

    if Enum.any?(Schema.fleet(), &(Atom.to_string(&1) == name and &1 != robot.id)),
      do: {["id"], "is #{inspect(robot.id)}, but the file is named #{name}.exs"}
  end

  defp seen(%{camera: camera, colours: nil}) when camera != nil,
    do: {["colours"], "is missing: a robot with a camera must have colours"}

  defp seen(_robot), do: nil

  defp kept(%{save_pictures: nil}), do: nil

  defp kept(%{camera: nil}),
    do: {["save_pictures"], "is for a robot with a camera, and it has none"}

  defp kept(_robot), do: nil

  defp placed(%{map: map, start: start}) do
    with line when line != nil <- Robot.File.Map.start(map, start), do: {["start"], line}
  end

  # A serial line has one device at its other end. A port may be a name in /dev.
  defp shared(%{drive: {_drive, drive}, ptz: {_head, head}}) do
    [base, head] = for options <- [drive, head], do: options[:port]

    if is_binary(base) and is_binary(head) and
         Path.expand(base, "/dev") == Path.expand(head, "/dev"),
       do: {["ptz", "port"], "is #{inspect(head)}, the drive's: each has a line of its own"}
  end

  defp shared(_robot), do: nil

  defp colour(%{colours: nil}), do: nil

  defp colour(%{colours: colours, policies: policies}) do
    names = Enum.map(colours.classes, & &1.name)
    colour = policies[:colour]

    if colour != nil and colour not in names,
      do:
        {["policies", "colour"],
         "expected one of the colours #{Enum.join(names, ", ")}, got #{inspect(colour)}" <>
           Suggest.hint(colour, names)}
  end

  # Some drives check their options against the body, such as how many sensors they read.
  defp driven(%{drive: drive, profile: profile}) do
    case Device.fit(drive, profile) do
      {:ok, _drive} -> []
      {:error, line} -> [{["drive"], line}]
    end
  end

  defp limits(%{limits: limits, profile: profile}) do
    for {name, value} <- limits, most = Map.fetch!(profile, name), value > most do
      {["limits", Atom.to_string(name)],
       "expected at most #{most}, which a #{profile.name} can do, got #{value}"}
    end
  end
end
