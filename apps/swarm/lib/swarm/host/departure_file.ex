defmodule Swarm.Host.DepartureFile do
  @moduledoc """
  Keeps the file by which the robot of this machine knows that it has left its start pose (`Robot.Departure`).

  It is in the release's folder of what does not outlive a boot. A person who starts the robot puts it at its start pose
  before, so the file goes; systemd may start it after a crash, so it stays, and goes with its folder when a person stops
  the service (`RuntimeDirectoryPreserve=restart` of `rel/convoy.service`).
  """
  require Logger
  alias Robot.Departure
  alias Swarm.Host.ReleaseBoot

  @doc """
  The path, and what starts the robot; `nil` outside a release.

      iex> Swarm.Host.DepartureFile.of(:mag1, %{"RELEASE_TMP" => "/run/convoy", "NOTIFY_SOCKET" => "/run/n"})
      {"/run/convoy/mag1.departed", :service}
      iex> Swarm.Host.DepartureFile.of(:mag1, %{"RELEASE_TMP" => "/opt/convoy/current/tmp"})
      {"/opt/convoy/current/tmp/mag1.departed", :person}
      iex> Swarm.Host.DepartureFile.of(:mag1, %{})
      nil
  """
  @spec of(robot :: atom(), ReleaseBoot.environment()) :: {Path.t(), :person | :service} | nil
  def of(robot, environment) do
    case environment do
      %{"RELEASE_TMP" => folder} when folder != "" ->
        by = if environment["NOTIFY_SOCKET"] in [nil, ""], do: :person, else: :service
        {Path.join(folder, "#{robot}.departed"), by}

      _no_release ->
        nil
    end
  end

  @doc "Makes its folder, and deletes the file of an earlier start if a person starts the robot; returns the path."
  @spec prepare({Path.t(), :person | :service} | nil) :: Path.t() | nil
  def prepare(nil), do: nil

  def prepare({path, by}) do
    # A folder that cannot be made shows when the robot leaves its start pose.
    _made = File.mkdir_p(Path.dirname(path))

    with :person <- by, {:error, reason} <- Departure.Note.delete(path) do
      reason = :file.format_error(reason)
      Logger.error("#{path} cannot be deleted (#{reason}): the robot will not know where it is")
    end

    path
  end
end
